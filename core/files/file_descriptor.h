#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <utility>

namespace cairn {

// An open file's descriptor, or the -1 that open() returned; closed by the destructor.
class FileDescriptor {
 public:
  explicit FileDescriptor(int descriptor) : descriptor_(descriptor) {}
  ~FileDescriptor() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  FileDescriptor(FileDescriptor&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&&) = delete;

  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

// Reads or writes all bytes at `offset`; false, with errno, where that is not possible (EIO: the file ends
// before).
bool ReadAllAt(int descriptor, void* bytes, size_t num_bytes, uint64_t offset);
bool WriteAllAt(int descriptor, const void* bytes, size_t num_bytes, uint64_t offset);

}  // namespace cairn
