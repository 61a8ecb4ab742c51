#include "pipeline/build/folder_lock.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <thread>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/files/file.h"
#include "core/files/folder_manifest.h"
#include "core/files/temporary.h"
#include "pipeline/build/build_files.h"
#include "pipeline/build/build_folder.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLockFile = "/lock";
// Other processes of the same session hold the folder exclusively only while they remove stale temporaries.
constexpr std::chrono::seconds kWaitForOwnSession{30};
// Another session may be about to end, or may try the lock and be refused as well.  A killed process takes
// long to end on a busy machine.
constexpr std::chrono::seconds kWaitForOtherSession{3};

using Claim = FileLock::Claim;

// Removes temporaries whose names `is_ours` accepts; folders only where they are cairn's.
template <typename IsOurs>
void RemoveTemporariesIn(const fs::path& folder, const IsOurs& is_ours) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (!IsTemporaryName(name, "") || !is_ours(name)) continue;
    std::error_code remove_error;  // one that cannot be removed only takes space
    if (entry.is_directory(remove_error) && !entry.is_symlink(remove_error))
      RemoveOwnFolder(entry.path().string());
    else
      fs::remove(entry.path(), remove_error);
  }
}

std::string ReadSession(int fd) {
  char text[HOST_NAME_MAX + 32] = {};
  const ssize_t size = pread(fd, text, sizeof(text) - 1, 0);
  std::string session(text, size > 0 ? size : 0);
  return session.substr(0, session.find('\n'));
}

bool WriteSession(int fd, const std::string& session) {
  const std::string line = session + "\n";
  return ftruncate(fd, 0) == 0 &&
         pwrite(fd, line.data(), line.size(), 0) == static_cast<ssize_t>(line.size());
}

// Makes the folder and opens its lock file.
Result<FileLock> OpenLockFile(const std::string& build_dir) {
  std::error_code error;
  fs::create_directories(build_dir, error);
  if (error)
    return MakeError(ErrorCode::kIo, "{}: the folder cannot be made: {}", build_dir, error.message());
  const std::string path = build_dir + kLockFile;
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (fd < 0) return MakeError(ErrorCode::kIo, "{}: cannot be opened: {}", path, std::strerror(errno));
  return FileLock(fd);
}

bool IsRemoved(int fd) {
  struct stat status = {};
  return fstat(fd, &status) == 0 && status.st_nlink == 0;
}

// One try.  Turning an exclusive lock into a shared one releases it for a moment: the session whose name is
// in the file afterwards has it.
Result<Claim> TryToClaim(FileLock& lock, const std::string& build_dir, const std::string& session) {
  const Claim alone = lock.Try(FileLock::Kind::kExclusive);
  if (alone == Claim::kNoLocks) return alone;
  if (alone == Claim::kHeld) {
    RemoveStaleTemporaries(build_dir);
    if (!WriteSession(lock.descriptor(), session)) {
      return MakeError(ErrorCode::kIo, "{}{}: cannot be written: {}", build_dir, kLockFile,
                       std::strerror(errno));
    }
    lock.Share();
  } else if (lock.Try(FileLock::Kind::kShared) != Claim::kHeld) {
    return Claim::kTaken;
  }
  if (ReadSession(lock.descriptor()) == session) return Claim::kHeld;
  lock.Release();
  return Claim::kTaken;
}

}  // namespace

std::string NewBuildSession() {
  char host[HOST_NAME_MAX + 1] = {};
  gethostname(host, sizeof(host) - 1);
  return fmt::format("{}@{}", getpid(), host);
}

std::string BuildSession() {
  const char* session = std::getenv(kBuildSessionVariable);
  return session != nullptr && *session != '\0' ? session : NewBuildSession();
}

std::string ReportPath(const std::string& map) {
  return fs::path(map).replace_extension().string() + kReportSuffix;
}

void RemoveStaleTemporaries(const std::string& build_dir) {
  RemoveTemporariesIn(build_dir, IsBuildFileName);
  RemoveTemporariesIn(build_dir + "/options", IsOptionsFileName);
  const fs::path map = ConfiguredMap(build_dir);
  if (map.empty()) return;
  RemoveTemporariesIn(map.parent_path(), [&](const std::string& name) {
    return IsTemporaryName(name, map.filename().string()) ||
           IsTemporaryName(name, fs::path(ReportPath(map.string())).filename().string());
  });
}

Result<FolderLock> FolderLock::Acquire(const std::string& build_dir, const std::string& session) {
  CAIRN_ASSIGN_OR_RETURN(FileLock lock, OpenLockFile(build_dir));
  const auto begin = std::chrono::steady_clock::now();
  while (true) {
    CAIRN_ASSIGN_OR_RETURN(const Claim claim, TryToClaim(lock, build_dir, session));
    if (claim == Claim::kHeld && !IsRemoved(lock.descriptor())) return FolderLock(std::move(lock));
    if (claim == Claim::kHeld) {  // `cairn clean` removed the lock file
      CAIRN_ASSIGN_OR_RETURN(lock, OpenLockFile(build_dir));
      continue;
    }
    if (claim == Claim::kNoLocks) {
      spdlog::warn(
          "{}: this file system has no locks; make sure that only one build at a time uses this folder",
          build_dir);
      return FolderLock(std::move(lock));
    }
    const std::string owner = ReadSession(lock.descriptor());
    const auto waited = std::chrono::steady_clock::now() - begin;
    if (owner == session ? waited > kWaitForOwnSession : waited > kWaitForOtherSession) {
      return MakeError(ErrorCode::kBusy,
                       "{}: another build (process {}) is at work in this build folder; wait for it, or give "
                       "another --build-dir",
                       build_dir, owner.empty() ? "unknown" : owner);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

}  // namespace cairn::pipeline
