#include "core/files/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <span>

#include "core/base/content_hash.h"
#include "core/files/file_descriptor.h"
#include "core/files/input_file.h"
#include "core/files/replacement.h"

namespace cairn {

namespace {

constexpr size_t kHashedPartBytes = size_t{1} << 16;

// A regular file that is read from its beginning on.
class InputFile {
 public:
  static Result<InputFile> Open(const std::string& path) {
    CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
    // Non-blocking: what has replaced the file since may be a pipe.
    InputFile file(path, open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    struct stat status = {};
    if (file.descriptor_.get() < 0 || fstat(file.descriptor_.get(), &status) != 0)
      return file.IoError("cannot be read");
    if (!S_ISREG(status.st_mode)) return MakeError(ErrorCode::kIo, "{}: is no longer a regular file", path);
    file.num_bytes_ = static_cast<size_t>(status.st_size);
    return file;
  }

  // When it was opened; 0 for files of /proc.
  size_t num_bytes() const { return num_bytes_; }

  // The number of bytes that were read, 0 at the end.
  Result<size_t> Read(std::span<char> buffer) {
    while (true) {
      const ssize_t num_read = read(descriptor_.get(), buffer.data(), buffer.size());
      if (num_read >= 0) return static_cast<size_t>(num_read);
      if (errno != EINTR) return IoError("reading failed");
    }
  }

 private:
  InputFile(const std::string& path, int descriptor) : path_(path), descriptor_(descriptor) {}

  Error IoError(const char* what) const {
    return MakeError(ErrorCode::kIo, "{}: {}: {}", path_, what, std::strerror(errno));
  }

  std::string path_;
  FileDescriptor descriptor_;
  size_t num_bytes_ = 0;
};

std::string HexDigits(const ContentHash& hash) { return fmt::format("{:016x}{:016x}", hash.high, hash.low); }

}  // namespace

Result<std::string> ReadFile(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(InputFile file, InputFile::Open(path));
  // One byte more than the file has, so that its end is seen at once.
  std::string contents(file.num_bytes() + 1, '\0');
  size_t num_bytes = 0;
  while (true) {
    if (num_bytes == contents.size()) contents.resize(2 * contents.size() + 4096);
    CAIRN_ASSIGN_OR_RETURN(const size_t num_read, file.Read(std::span(contents).subspan(num_bytes)));
    if (num_read == 0) break;
    num_bytes += num_read;
  }
  contents.resize(num_bytes);
  return contents;
}

std::string ReadHead(const std::string& path, size_t num_bytes) {
  Result<InputFile> file = InputFile::Open(path);
  if (!file.ok()) return "";
  std::string head(num_bytes, '\0');
  size_t num_read = 0;
  while (num_read < num_bytes) {
    const Result<size_t> more = file->Read(std::span(head).subspan(num_read));
    if (!more.ok() || *more == 0) break;
    num_read += *more;
  }
  head.resize(num_read);
  return head;
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

std::string HashBytes(std::string_view bytes) { return HexDigits(HashContents(bytes)); }

Result<std::string> HashFile(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(InputFile file, InputFile::Open(path));
  PartsHasher hasher;
  std::string part(kHashedPartBytes, '\0');
  while (true) {
    CAIRN_ASSIGN_OR_RETURN(const size_t num_read, file.Read(part));
    if (num_read == 0) return HexDigits(hasher.Finish());
    hasher.Add({part.data(), num_read});
  }
}

}  // namespace cairn
