#include "core/files/replacement.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>
#include <utility>
#include <vector>

#include "core/files/file_descriptor.h"
#include "core/files/output_path.h"
#include "core/files/temporary.h"
#include "core/files/write_error.h"

namespace cairn {
namespace {

constexpr size_t kChunkBytes = size_t{1} << 16;

// Reads until `buffer` is full or the file ends; less than 0: an error, in errno.
ssize_t ReadFully(int descriptor, std::vector<char>* buffer) {
  size_t num_read = 0;
  while (num_read < buffer->size()) {
    const ssize_t more = read(descriptor, buffer->data() + num_read, buffer->size() - num_read);
    if (more < 0 && errno == EINTR) continue;
    if (more < 0) return more;
    if (more == 0) break;
    num_read += static_cast<size_t>(more);
  }
  return static_cast<ssize_t>(num_read);
}

// Whether the file at `path` has the bytes of the open one.  A file that cannot be read counts as different.
bool HasBytesOf(const std::string& path, int file) {
  const FileDescriptor target(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat new_status = {}, old_status = {};
  if (target.get() < 0 || fstat(file, &new_status) != 0 || fstat(target.get(), &old_status) != 0 ||
      !S_ISREG(old_status.st_mode) || new_status.st_size != old_status.st_size ||
      lseek(file, 0, SEEK_SET) != 0) {
    return false;
  }
  std::vector<char> new_bytes(kChunkBytes), old_bytes(kChunkBytes);
  off_t num_compared = 0;
  while (true) {
    const ssize_t num_new = ReadFully(file, &new_bytes);
    const ssize_t num_old = ReadFully(target.get(), &old_bytes);
    if (num_new < 0 || num_new != num_old) return false;
    if (std::memcmp(new_bytes.data(), old_bytes.data(), static_cast<size_t>(num_new)) != 0) return false;
    num_compared += num_new;
    if (num_new == 0) return num_compared == new_status.st_size;
  }
}

// Whether the name still leads to the open file.
bool IsNameOf(const std::string& path, int file) {
  struct stat named = {}, opened = {};
  return lstat(path.c_str(), &named) == 0 && fstat(file, &opened) == 0 && named.st_dev == opened.st_dev &&
         named.st_ino == opened.st_ino;
}

// Fails where a file exists.  On file systems that cannot do it in one step: a second name (link), which
// also fails.
int RenameToNew(const std::string& from, const std::string& to) {
  if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL && errno != ENOSYS) return -1;
  return link(from.c_str(), to.c_str()) == 0 ? unlink(from.c_str()) : -1;
}

}  // namespace

Result<Replacement> Replacement::Begin(const std::string& path, mode_t new_mode) {
  CAIRN_RETURN_IF_ERROR(CheckCanBeReplaced(path));
  Replacement file;
  file.path_ = path;
  const std::string folder = FolderOf(path);
  file.folder_ = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file.folder_ < 0) return WriteError(path, fmt::format("its folder {} cannot be opened", folder), errno);
  struct stat status = {};
  if (stat(path.c_str(), &status) == 0) {
    file.replaced_ = status;
  } else if (errno != ENOENT) {
    return WriteError(path, "cannot be replaced", errno);
  }
  CAIRN_ASSIGN_OR_RETURN(TemporaryFile temporary, CreateTemporary(path, file.replaced_ ? 0600 : new_mode));
  file.temporary_ = std::move(temporary.path);
  file.file_ = temporary.descriptor;
  return file;
}

Replacement::Replacement(Replacement&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::exchange(other.temporary_, "")),
      file_(std::exchange(other.file_, -1)),
      folder_(std::exchange(other.folder_, -1)),
      replaced_(other.replaced_),
      is_in_place_(other.is_in_place_) {}

Replacement::~Replacement() {
  if (file_ >= 0) close(file_);
  if (folder_ >= 0) close(folder_);
  if (temporary_.empty()) return;
  for (const char* suffix : {"", "-journal", "-wal", "-shm"}) {
    char path[PATH_MAX];  // there may be no memory for a string
    const int length = std::snprintf(path, sizeof(path), "%s%s", temporary_.c_str(), suffix);
    if (length > 0 && length < static_cast<int>(sizeof(path))) unlink(path);
  }
}

Status Replacement::Write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t num_written = write(file_, bytes.data(), bytes.size());
    if (num_written < 0 && errno == EINTR) continue;
    if (num_written < 0) return WriteError(path_, "cannot be written", errno);
    bytes.remove_prefix(static_cast<size_t>(num_written));
  }
  return Ok();
}

Status Replacement::CopyFrom(const std::string& source_path) {
  const FileDescriptor source(open(source_path.c_str(), O_RDONLY | O_CLOEXEC));
  if (source.get() < 0) {
    return MakeError(errno == ENOENT ? ErrorCode::kNotFound : ErrorCode::kIo, "{}: cannot be read: {}",
                     source_path, std::strerror(errno));
  }
  std::vector<char> chunk(kChunkBytes);
  while (true) {
    const ssize_t num_read = ReadFully(source.get(), &chunk);
    if (num_read < 0)
      return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", source_path, std::strerror(errno));
    if (num_read == 0) return Ok();
    CAIRN_RETURN_IF_ERROR(Write({chunk.data(), static_cast<size_t>(num_read)}));
  }
}

Status Replacement::Finish() {
  if (!HasBytesOf(path_, file_)) return PutInPlace(/*may_replace=*/true);
  is_in_place_ = true;  // it already was, but whoever put it there may not have synced the folder
  return SyncFolderOf(path_, folder_);
}

Status Replacement::FinishNew() { return PutInPlace(/*may_replace=*/false); }

Status Replacement::PutInPlace(bool may_replace) {
  if (!IsNameOf(temporary_, file_))
    return MakeError(ErrorCode::kIo, "{}: cannot be written: another program has taken away {}", path_,
                     temporary_);
  if (may_replace && replaced_) CAIRN_RETURN_IF_ERROR(GiveAttributes(file_, *replaced_, path_));
  if (fsync(file_) != 0) return WriteError(path_, "cannot be synced", errno);
  // Some file systems report delayed errors only here.
  if (close(std::exchange(file_, -1)) != 0 && errno != EINTR)
    return WriteError(path_, "cannot be written", errno);
  if (may_replace) {
    if (rename(temporary_.c_str(), path_.c_str()) != 0) return WriteError(path_, "cannot be replaced", errno);
  } else if (RenameToNew(temporary_, path_) != 0) {
    if (errno != EEXIST) return WriteError(path_, "cannot be created", errno);
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: already exists and is not overwritten; choose another name", path_);
  }
  temporary_.clear();
  is_in_place_ = true;
  return SyncFolderOf(path_, folder_);
}

Status GiveAttributes(int descriptor, const struct stat& attributes, const std::string& path) {
  struct stat own = {};
  if (fstat(descriptor, &own) != 0) return WriteError(path, "cannot be written", errno);
  bool has_owner = own.st_uid == attributes.st_uid;
  bool has_group = own.st_gid == attributes.st_gid;
  if (!(has_owner && has_group)) {
    if (fchown(descriptor, attributes.st_uid, attributes.st_gid) == 0) {
      has_owner = has_group = true;
    } else if (!has_group) {
      has_group = fchown(descriptor, -1, attributes.st_gid) == 0;
    }
  }
  mode_t mode = attributes.st_mode & 0777;
  const bool all_read = (mode & S_IROTH) != 0;
  const bool group_reads = (mode & S_IRGRP) != 0;
  if ((!has_owner && !all_read && !(has_group && group_reads)) || (!has_group && group_reads && !all_read)) {
    return MakeError(ErrorCode::kReadOnly,
                     "{}: is of user {} and group {} with mode {:o}, which user {} cannot give to a new "
                     "file: they could no longer read it; run this as its owner or as root",
                     path, attributes.st_uid, attributes.st_gid, mode, geteuid());
  }
  // The other group gets the permissions that everybody has.
  if (!has_group) mode = (mode & ~mode_t{070}) | (mode & 07) << 3;
  if ((own.st_mode & 0777) != mode && fchmod(descriptor, mode) != 0)
    return WriteError(path, fmt::format("a new file cannot be given mode {:o}", mode), errno);
  return Ok();
}

Status SyncFolderOf(const std::string& path, int folder_descriptor) {
  // EINVAL: a file system that has nothing to sync there.
  if (fsync(folder_descriptor) == 0 || errno == EINVAL) return Ok();
  return WriteError(path,
                    fmt::format("is in place; but its folder {} cannot be synced, and a power cut may bring "
                                "back what was there before",
                                FolderOf(path)),
                    errno);
}

}  // namespace cairn
