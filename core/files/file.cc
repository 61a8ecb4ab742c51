#include "core/files/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/base/content_hash.h"
#include "core/files/file_descriptor.h"
#include "core/files/input_file.h"
#include "core/files/replacement.h"

namespace cairn {

Result<std::string> ReadFile(const std::string& path) {
  const auto error = [&](const char* what) {
    return MakeError(ErrorCode::kIo, "{}: {}: {}", path, what, std::strerror(errno));
  };
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  // Non-blocking: what has replaced the file since may be a pipe.
  const FileDescriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (file.get() < 0) return error("cannot be read");
  struct stat status = {};
  if (fstat(file.get(), &status) != 0) return error("cannot be read");
  if (!S_ISREG(status.st_mode)) return MakeError(ErrorCode::kIo, "{}: is no longer a regular file", path);
  // One byte more than the file has, so that its end is seen at once; files of /proc say 0.
  std::string contents(static_cast<size_t>(status.st_size) + 1, '\0');
  size_t num_bytes = 0;
  while (true) {
    if (num_bytes == contents.size()) contents.resize(2 * contents.size() + 4096);
    const ssize_t num_read = read(file.get(), contents.data() + num_bytes, contents.size() - num_bytes);
    if (num_read < 0 && errno == EINTR) continue;
    if (num_read < 0) return error("reading failed");
    if (num_read == 0) break;
    num_bytes += static_cast<size_t>(num_read);
  }
  contents.resize(num_bytes);
  return contents;
}

Status ReplaceFileAtomically(const std::string& path,
                             const std::function<Status(const std::string&)>& write) {
  CAIRN_ASSIGN_OR_RETURN(Replacement file, Replacement::Begin(path));
  CAIRN_RETURN_IF_ERROR(write(file.temporary()));
  return file.Finish();
}

Status WriteFileAtomically(const std::string& path, std::string_view contents) {
  CAIRN_ASSIGN_OR_RETURN(Replacement file, Replacement::Begin(path));
  CAIRN_RETURN_IF_ERROR(file.Write(contents));
  return file.Finish();
}

std::string HashBytes(std::string_view bytes) {
  const ContentHash hash = HashContents(bytes);
  return fmt::format("{:016x}{:016x}", hash.high, hash.low);
}

Result<std::string> HashFile(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  return HashBytes(contents);
}

}  // namespace cairn
