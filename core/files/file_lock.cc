#include "core/files/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "core/files/file_descriptor.h"
#include "core/files/output_path.h"

namespace cairn {

bool HasRecordLocks(const std::string& path) {
  const FileDescriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct flock lock = {};
  lock.l_type = F_RDLCK;
  lock.l_whence = SEEK_SET;
  lock.l_len = 1;
  return file.get() < 0 || fcntl(file.get(), F_GETLK, &lock) == 0 ||
         (errno != ENOLCK && errno != ENOSYS && errno != ENOTSUP);
}

FileLock::FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

FileLock& FileLock::operator=(FileLock&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

FileLock::Claim FileLock::Try(Kind kind) {
  if (flock(descriptor_, (kind == Kind::kShared ? LOCK_SH : LOCK_EX) | LOCK_NB) == 0) return Claim::kHeld;
  return errno == EWOULDBLOCK || errno == EINTR ? Claim::kTaken : Claim::kNoLocks;
}

void FileLock::Share() {
  while (flock(descriptor_, LOCK_SH) != 0 && errno == EINTR) continue;
}

void FileLock::Release() { flock(descriptor_, LOCK_UN); }

Result<FileLock> LockFolderOf(const std::string& path) {
  FileLock lock(open(FolderOf(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock.descriptor() < 0) {
    return MakeError(errno == ENOENT ? ErrorCode::kNotFound : ErrorCode::kIo, "{}: its folder: {}", path,
                     std::strerror(errno));
  }
  if (lock.Try(FileLock::Kind::kExclusive) == FileLock::Claim::kHeld) return lock;
  return MakeError(ErrorCode::kBusy, "{}: another update or rollback is running in its folder; try again",
                   path);
}

}  // namespace cairn
