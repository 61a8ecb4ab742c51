#include "core/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/content_hash.h"
#include "core/input_file.h"
#include "core/output_path.h"
#include "core/temporary.h"
#include "core/write_error.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

Status SyncPath(const std::string& path, int flags) {
  const int fd = open(path.c_str(), flags | O_CLOEXEC);
  if (fd < 0)
    return MakeError(ErrorCode::kIo, "{}: cannot be opened for syncing: {}", path, std::strerror(errno));
  const int rc = fsync(fd);
  const int error = errno;
  close(fd);
  if (rc != 0) return WriteError(path, "cannot be synced", error);
  return Ok();
}

bool SameBytes(const std::string& path1, const std::string& path2) {
  std::error_code error;
  const auto size1 = fs::file_size(path1, error);
  if (error) return false;
  const auto size2 = fs::file_size(path2, error);
  if (error || size1 != size2) return false;
  std::ifstream file1(path1, std::ios::binary), file2(path2, std::ios::binary);
  std::string block1(1 << 16, '\0'), block2(1 << 16, '\0');
  while (file1 && file2) {
    file1.read(block1.data(), block1.size());
    file2.read(block2.data(), block2.size());
    if (file1.gcount() != file2.gcount()) return false;
    if (std::memcmp(block1.data(), block2.data(), file1.gcount()) != 0) return false;
  }
  return true;
}

}  // namespace

Result<std::string> ReadFile(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  // What took the file's place since does not hold us up.
  const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, std::strerror(errno));
  struct stat status = {};
  std::string contents;
  size_t num_bytes = 0;
  ssize_t num_read = fstat(fd, &status) == 0 && S_ISREG(status.st_mode) ? 1 : -1;
  // One byte more than the size, so that its end is found at once; files of /proc say 0.
  contents.resize(std::max<int64_t>(status.st_size, 4095) + 1);
  while (num_read > 0) {
    if (num_bytes == contents.size()) contents.resize(2 * num_bytes);
    do {
      num_read = read(fd, contents.data() + num_bytes, contents.size() - num_bytes);
    } while (num_read < 0 && errno == EINTR);
    if (num_read > 0) num_bytes += num_read;
  }
  const int error = errno;
  close(fd);
  if (num_read < 0) return MakeError(ErrorCode::kIo, "{}: reading failed: {}", path, std::strerror(error));
  contents.resize(num_bytes);
  return contents;
}

Status ReplaceFileAtomically(const std::string& path,
                             const std::function<Status(const std::string&)>& write) {
  CAIRN_RETURN_IF_ERROR(CheckCanBeReplaced(path));
  const std::string folder = FolderOf(path);
  std::error_code error;
  const std::string temporary = TemporaryPath(path);
  fs::remove(temporary, error);
  Status status = write(temporary);
  if (status.ok() && SameBytes(temporary, path)) {
    fs::remove(temporary, error);
    return Ok();
  }
  if (status.ok()) status = SyncPath(temporary, O_RDONLY);
  if (status.ok() && std::rename(temporary.c_str(), path.c_str()) != 0) {
    status = WriteError(path, "cannot be replaced", errno);
  }
  if (!status.ok()) {
    for (const char* suffix : {"", "-journal", "-wal", "-shm"}) fs::remove(temporary + suffix, error);
    return status;
  }
  return SyncPath(folder, O_RDONLY | O_DIRECTORY);
}

Status WriteFileAtomically(const std::string& path, std::string_view contents) {
  return ReplaceFileAtomically(path, [&](const std::string& temporary) -> Status {
    std::ofstream file(temporary, std::ios::binary);
    file.write(contents.data(), static_cast<std::streamsize>(contents.size()));
    file.close();
    if (!file) return WriteError(path, "cannot be written", errno);
    return Ok();
  });
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
