#include "core/files/folder.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "core/files/folder_manifest.h"
#include "core/files/output_path.h"
#include "core/files/temporary.h"
#include "core/files/write_error.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAside = "-old";  // after a temporary's name: the old folder, moved aside

// `sync`: fsync for the folder's own entries, syncfs for all that was written to its file system.
Status Sync(const std::string& folder, int (*sync)(int)) {
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return WriteError(folder, "cannot be synced", errno);
  const int synced = sync(fd);
  const int error = errno;
  close(fd);
  // EINVAL: a file system that has nothing to sync there.
  return synced == 0 || error == EINVAL ? Ok() : WriteError(folder, "cannot be synced", error);
}

bool Exists(const std::string& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

// Puts the whole folder `temporary` in the place of `path`, in one step where the file system can.  What was
// there before is then at `*old_folder`; "" if there was nothing.
Status Exchange(const std::string& temporary, const std::string& path, std::string* old_folder) {
  if (!Exists(path)) {
    // A folder that appeared meanwhile is not empty and stays.
    if (std::rename(temporary.c_str(), path.c_str()) == 0) return Ok();
    return WriteError(path, "cannot be created", errno);
  }
  *old_folder = temporary;
  if (renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, path.c_str(), RENAME_EXCHANGE) == 0) return Ok();
  // File systems that cannot exchange: the old folder is moved aside first, and moved back if that fails.
  *old_folder = temporary + kAside;
  if (std::rename(path.c_str(), old_folder->c_str()) != 0)
    return WriteError(path, "cannot be replaced", errno);
  if (std::rename(temporary.c_str(), path.c_str()) == 0) return Ok();
  const Error error = WriteError(path, "cannot be replaced", errno);
  std::rename(old_folder->c_str(), path.c_str());
  return error;
}

Status PutInPlace(const std::string& temporary, const std::string& path) {
  KeepDates(temporary, path);
  std::string old_folder;
  Status status = Sync(temporary, syncfs);
  if (status.ok()) status = Exchange(temporary, path, &old_folder);
  if (!status.ok()) {
    RemoveOwnFolder(temporary);
    return status;
  }
  CAIRN_RETURN_IF_ERROR(Sync(FolderOf(path), fsync));
  if (old_folder.empty() || RemoveOwnFolder(old_folder)) return Ok();
  return MakeError(ErrorCode::kIo,
                   "{}: was written, but the folder that it replaces changed meanwhile and is kept as {}",
                   path, old_folder);
}

// Removes what killed processes left beside `path`.  A process that died between two renames left the old
// folder aside: it is moved back.
void RemoveLeftovers(const std::string& path, const std::string& kind) {
  for (const std::string& leftover : TemporariesOf(path)) {
    const auto process =
        static_cast<pid_t>(std::strtol(leftover.c_str() + leftover.rfind(".tmp-") + 5, nullptr, 10));
    if (process <= 0 || kill(process, 0) == 0 || errno != ESRCH) continue;
    std::error_code error;
    if (leftover.ends_with(kAside) && !Exists(path) && CheckOwnFolder(leftover, kind).ok())
      fs::rename(leftover, path, error);
    else
      RemoveOwnFolder(leftover);
  }
}

// Refuses to replace a folder that cairn did not make.
Status CheckTarget(const std::string& path, const std::string& kind) {
  std::error_code error;
  const fs::file_status status = fs::symlink_status(path, error);
  if (!fs::exists(status)) {
    const std::string parent = FolderOf(path);
    if (fs::is_directory(parent, error)) return Ok();
    return MakeError(ErrorCode::kIo, "{}: the folder {} does not exist; create it first", path, parent);
  }
  if (!fs::is_directory(status)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is {}, expected a folder; remove it or name another",
                     path, fs::is_symlink(status) ? "a link" : "a file");
  }
  return CheckOwnFolder(path, kind);
}

}  // namespace

Status ReplaceFolderAtomically(const std::string& path, const std::string& kind,
                               const std::function<Status(const std::string&)>& write) {
  std::string target = path;
  while (target.size() > 1 && target.back() == '/') target.pop_back();
  RemoveLeftovers(target, kind);
  CAIRN_RETURN_IF_ERROR(CheckTarget(target, kind));
  // Processes in two containers may have one number.
  const std::string temporary = RandomTemporaryPath(target);
  std::error_code error;
  if (!fs::create_directory(temporary, error)) {
    return WriteError(temporary, "cannot be created", error ? error.value() : EEXIST);
  }
  Status status = BeginOwnFolder(temporary, kind);
  if (status.ok()) status = write(temporary);
  if (status.ok()) status = FinishOwnFolder(temporary, kind);
  // A folder that already holds the same keeps its date; one that others changed while this one was
  // made stays.
  const bool is_same = status.ok() && HoldsTheSame(target, temporary);
  if (status.ok() && !is_same) status = CheckTarget(target, kind);
  if (status.ok() && !is_same) return PutInPlace(temporary, target);
  fs::remove_all(temporary, error);
  return status;
}

}  // namespace cairn
