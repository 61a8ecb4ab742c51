#include "core/folder.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "core/output_path.h"
#include "core/temporary.h"
#include "core/write_error.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Puts the whole folder `temporary` in the place of `path`, in one step where there is something already.
Status ReplaceFolder(const std::string& temporary, const std::string& path) {
  const int fd = open(temporary.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const int synced = fd < 0 ? -1 : syncfs(fd);
  if (fd >= 0) close(fd);
  if (synced != 0) return WriteError(temporary, "cannot be synced", errno);
  std::error_code error;
  if (!fs::exists(path, error)) {
    if (std::rename(temporary.c_str(), path.c_str()) == 0) return Ok();
    return WriteError(path, "cannot be created", errno);
  }
  if (renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, path.c_str(), RENAME_EXCHANGE) != 0) {
    // File systems that cannot exchange: the old folder steps aside first.
    const std::string aside = temporary + "-old";
    if (std::rename(path.c_str(), aside.c_str()) != 0 || std::rename(temporary.c_str(), path.c_str()) != 0) {
      return WriteError(path, "cannot be replaced", errno);
    }
    fs::remove_all(aside, error);
  }
  fs::remove_all(temporary, error);
  return Ok();
}

// Removes the temporary folders beside `path` of processes that were killed.
void RemoveLeftovers(const std::string& path) {
  const fs::path target(path);
  std::vector<fs::path> leftovers;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(FolderOf(path), error)) {
    const std::string name = entry.path().filename().string();
    if (!IsTemporaryName(name, target.filename().string())) continue;
    const auto process = static_cast<pid_t>(std::strtol(name.c_str() + name.rfind(".tmp-") + 5, nullptr, 10));
    if (process > 0 && kill(process, 0) != 0 && errno == ESRCH) leftovers.push_back(entry.path());
  }
  for (const fs::path& leftover : leftovers) fs::remove_all(leftover, error);
}

// Refuses to replace what is not of the kind.
Status CheckTarget(const std::string& path, const std::string& kind, const std::vector<std::string>& marks) {
  std::error_code error;
  if (!fs::exists(path, error)) {
    const std::string parent = FolderOf(path);
    if (fs::is_directory(parent, error)) return Ok();
    return MakeError(ErrorCode::kIo, "{}: the folder {} does not exist; create it first", path, parent);
  }
  if (!fs::is_directory(path, error)) {
    return MakeError(ErrorCode::kIo, "{}: is a file, expected a folder; remove it or name another", path);
  }
  const auto is_marked = [&](const std::string& mark) { return fs::exists(fs::path(path) / mark, error); };
  if (!fs::is_empty(path, error) && std::none_of(marks.begin(), marks.end(), is_marked)) {
    return MakeError(ErrorCode::kIo,
                     "{}: is a folder, but not {} (it has no {}), and is not replaced; remove it or name "
                     "another",
                     path, kind, fmt::join(marks, " or "));
  }
  return Ok();
}

}  // namespace

Status ReplaceFolderAtomically(const std::string& path, const std::string& kind,
                               const std::vector<std::string>& marks,
                               const std::function<Status(const std::string&)>& write) {
  std::string target = path;
  while (target.size() > 1 && target.back() == '/') target.pop_back();
  CAIRN_RETURN_IF_ERROR(CheckTarget(target, kind, marks));
  RemoveLeftovers(target);
  const std::string temporary = TemporaryPath(target);
  std::error_code error;
  fs::remove_all(temporary, error);
  if (!fs::create_directories(temporary, error)) {
    return WriteError(temporary, "cannot be created", error.value());
  }
  Status status = write(temporary);
  if (status.ok()) status = ReplaceFolder(temporary, target);
  if (!status.ok()) fs::remove_all(temporary, error);
  return status;
}

}  // namespace cairn
