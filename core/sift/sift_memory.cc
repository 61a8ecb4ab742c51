#include "core/sift/sift_memory.h"

#include <sys/mman.h>

#include <memory>
#include <new>

namespace cairn {
namespace {

constexpr size_t kLargePage = size_t{2} << 20;

}  // namespace

float* SiftMemory::Take(size_t num) {
  if (num <= num_) return floats_;
  Free();
  const size_t num_bytes = num * sizeof(float), num_to_map = num_bytes + kLargePage;
  void* const mapped = mmap(nullptr, num_to_map, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED) throw std::bad_alloc();
  mapped_ = mapped;
  num_mapped_bytes_ = num_to_map;
  void* first = mapped;
  size_t space = num_to_map;
  std::align(kLargePage, num_bytes, first, space);
  madvise(first, space, MADV_HUGEPAGE);  // no harm where it is refused
  floats_ = static_cast<float*>(first);
  num_ = num;
  return floats_;
}

void SiftMemory::Trim(size_t max_num) {
  if (num_ > max_num) Free();
}

void SiftMemory::Free() {
  if (mapped_ != nullptr) munmap(mapped_, num_mapped_bytes_);
  mapped_ = nullptr;
  floats_ = nullptr;
  num_ = 0;
}

}  // namespace cairn
