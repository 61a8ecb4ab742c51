#pragma once

#include <cstddef>
#include <vector>

namespace cairn {

// Memory that a thread gives back is kept, up to 16 MiB, for what it takes next: work that repeats, as the
// frames of a drive, asks the system for nothing once it has asked for the most that it needs.  Aligned to
// cache lines.  What one thread takes another may give back.  Throws: bad_alloc.
void* TakePooled(size_t num_bytes);
void GivePooled(void* memory) noexcept;
// What so many bytes take: an eighth more at most, and a cache line.
size_t PooledSize(size_t num_bytes);

template <typename T>
struct PoolAllocator {
  using value_type = T;
  PoolAllocator() = default;
  template <typename U>
  PoolAllocator(const PoolAllocator<U>& /*other*/) {}  // NOLINT: allocators convert
  T* allocate(size_t num) { return static_cast<T*>(TakePooled(num * sizeof(T))); }
  void deallocate(T* memory, size_t /*num*/) noexcept { GivePooled(memory); }
  friend bool operator==(const PoolAllocator&, const PoolAllocator&) { return true; }
};

template <typename T>
using PooledVector = std::vector<T, PoolAllocator<T>>;

}  // namespace cairn
