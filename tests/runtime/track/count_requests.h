// A count of the requests for memory in a program: of glibc's allocator, whoever asks.  Included once in it.
#pragma once

#include <malloc.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>

namespace cairn {

inline std::atomic<long> num_requests{0};

}  // namespace cairn

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which have allocators of their own
// glibc's own, counted.
extern "C" {
void* __libc_malloc(size_t num_bytes);
void* __libc_realloc(void* block, size_t num_bytes);
void* __libc_memalign(size_t alignment, size_t num_bytes);
void* __libc_calloc(size_t num, size_t num_bytes);

void* malloc(size_t num_bytes) {
  ++cairn::num_requests;
  return __libc_malloc(num_bytes);
}
void* realloc(void* block, size_t num_bytes) {
  ++cairn::num_requests;
  return __libc_realloc(block, num_bytes);
}
void* calloc(size_t num, size_t num_bytes) {
  ++cairn::num_requests;
  return __libc_calloc(num, num_bytes);
}
void* aligned_alloc(size_t alignment, size_t num_bytes) {
  ++cairn::num_requests;
  return __libc_memalign(alignment, num_bytes);
}
int posix_memalign(void** block, size_t alignment, size_t num_bytes) {
  ++cairn::num_requests;
  *block = __libc_memalign(alignment, num_bytes);
  return *block == nullptr ? ENOMEM : 0;
}
void* memalign(size_t alignment, size_t num_bytes) {
  ++cairn::num_requests;
  return __libc_memalign(alignment, num_bytes);
}
}
#endif
