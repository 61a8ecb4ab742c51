#include "core/files/file_descriptor.h"

#include <sys/types.h>

#include <cerrno>

namespace cairn {
namespace {

template <typename Transfer, typename Pointer>
bool TransferAll(const Transfer& transfer, int descriptor, Pointer bytes, size_t num_bytes, uint64_t offset) {
  while (num_bytes > 0) {
    const ssize_t num = transfer(descriptor, bytes, num_bytes, static_cast<off_t>(offset));
    if (num < 0 && errno == EINTR) continue;
    if (num == 0) errno = EIO;
    if (num <= 0) return false;
    bytes += num;
    num_bytes -= static_cast<size_t>(num);
    offset += static_cast<uint64_t>(num);
  }
  return true;
}

}  // namespace

bool ReadAllAt(int descriptor, void* bytes, size_t num_bytes, uint64_t offset) {
  return TransferAll(pread, descriptor, static_cast<char*>(bytes), num_bytes, offset);
}

bool WriteAllAt(int descriptor, const void* bytes, size_t num_bytes, uint64_t offset) {
  return TransferAll(pwrite, descriptor, static_cast<const char*>(bytes), num_bytes, offset);
}

}  // namespace cairn
