#pragma once

#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/files/file_lock.h"

namespace cairn::pipeline {

// Environment variable with the name of the build that a stage belongs to: `cairn compile` and map.mk set it,
// so that the stages of one run of make share their build folder and those of another run are kept out.
inline constexpr const char* kBuildSessionVariable = "CAIRN_BUILD_SESSION";

// The name in that variable or, where there is none, a new one: "PROCESS@HOST".
std::string BuildSession();
std::string NewBuildSession();

// A report lies beside what it is about: NAME.report.json beside NAME.cairn.
inline constexpr const char* kReportSuffix = ".report.json";
std::string ReportPath(const std::string& map);

// Removes the temporaries that killed runs left in the build folder, in its options, and beside its map.
// REQUIRES: no other process uses the folder.
void RemoveStaleTemporaries(const std::string& build_dir);

// Holds a build folder for the processes of one session at a time, as long as the object lives, on this
// machine or over a network file system.  Child processes inherit the lock: it also lasts as long as a stage
// that a killed compile left behind.  The first process removes stale temporaries.
//
// BUILD/lock has the session's name; its processes hold a shared flock on it.  A process that finds no lock
// takes an exclusive one first.
class FolderLock {
 public:
  // Makes the folder if there is none.  Where the file system has no locks, warns and continues without one.
  // Errors: Busy (says which session has it), Io.
  static Result<FolderLock> Acquire(const std::string& build_dir, const std::string& session);

 private:
  explicit FolderLock(FileLock lock) : lock_(std::move(lock)) {}
  FileLock lock_;
};

}  // namespace cairn::pipeline
