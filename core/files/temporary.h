#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/files/file_descriptor.h"

namespace cairn {

// Where a file is written before it takes the target's place: TARGET.tmp-PROCESS, beside it.
std::string TemporaryPath(const std::string& target);
// The same for a file or a folder, under a name that nobody can predict: TARGET.tmp-PROCESS-RANDOM.
std::string RandomTemporaryPath(const std::string& target);
// Whether a name is that of such a temporary of `target` (a name; "" = of anything), or of what SQLite, a
// replaced folder or a temporary's own temporary leaves beside one: TARGET.tmp-PROCESS-journal, -old.
bool IsTemporaryName(const std::string& name, const std::string& target);

// The paths of such temporaries beside `target`, sorted; none where its folder cannot be listed. (libstdc++'s
// directory_iterator ends the program where there is no memory.)
std::vector<std::string> TemporariesOf(const std::string& target);

// A file that this process has just created, empty and open for reading and writing.
struct TemporaryFile {
  std::string path;
  int descriptor = -1;  // the caller closes it
};
// Creates a file beside `target` with this mode, less the umask.  Never opens a file that already exists, nor
// follows a link that somebody planted.  Errors: ReadOnly, DiskFull, Io.
Result<TemporaryFile> CreateTemporary(const std::string& target, mode_t mode);

// A file without a name for what memory has no room for: made where `beside` is when something is first
// written to it, gone with this object.
class ScratchFile {
 public:
  explicit ScratchFile(std::string beside) : beside_(std::move(beside)) {}

  // Errors: ReadOnly, DiskFull, Io.
  Status Append(const void* bytes, size_t num_bytes);
  // On any thread.  REQUIRES: the bytes were appended.  Errors: Io.
  Status Read(uint64_t offset, void* bytes, size_t num_bytes) const;
  uint64_t num_bytes() const { return num_bytes_; }

 private:
  std::string beside_;
  std::optional<FileDescriptor> file_;
  uint64_t num_bytes_ = 0;
};

}  // namespace cairn
