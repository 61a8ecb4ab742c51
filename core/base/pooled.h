#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace cairn {

// Memory that a thread gives back is kept, up to 16 MiB, for what it takes next: work that repeats, as the
// frames of a drive, asks the system for nothing once it has asked for the most that it needs.  Aligned to
// cache lines.  What one thread takes another may give back.  Throws: bad_alloc.
void* TakePooled(size_t num_bytes);
void GivePooled(void* memory) noexcept;
// What so many bytes take: an eighth more at most, and a cache line.  A block that was kept for other work
// may be up to twice as large.
size_t PooledSize(size_t num_bytes);
// Whether threads keep anything: not under sanitizers, which must see what is used after it was given back.
bool KeepsPooled();

template <typename T>
struct PoolAllocator {
  using value_type = T;
  PoolAllocator() = default;
  template <typename U>
  PoolAllocator(const PoolAllocator<U>& /*other*/) {}  // NOLINT: allocators convert
  T* allocate(size_t num) {
    static_assert(alignof(T) <= 64);
    return static_cast<T*>(TakePooled(num * sizeof(T)));
  }
  void deallocate(T* memory, size_t /*num*/) noexcept { GivePooled(memory); }
  friend bool operator==(const PoolAllocator&, const PoolAllocator&) { return true; }
};

template <typename T>
using PooledVector = std::vector<T, PoolAllocator<T>>;

// As std::make_shared, in such memory.
template <typename T, typename... Args>
std::shared_ptr<T> MakePooled(Args&&... args) {
  return std::allocate_shared<T>(PoolAllocator<T>(), std::forward<Args>(args)...);
}

}  // namespace cairn
