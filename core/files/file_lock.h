#pragma once

#include <string>

#include "core/base/error.h"

namespace cairn {

// Whether the file system of a file that can be read has locks of parts of files (fcntl), as SQLite wants
// them: some network file systems have none.
bool HasRecordLocks(const std::string& path);

// A lock between processes, held as long as the object lives: an flock on an open file or folder.  Child
// processes that inherit the descriptor hold the lock too.
class FileLock {
 public:
  enum class Kind { kShared, kExclusive };
  enum class Claim { kHeld, kTaken, kNoLocks };  // kNoLocks: the file system has none

  // Takes over an open file's descriptor; nothing is locked yet.
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&& other) noexcept;
  ~FileLock();

  int descriptor() const { return descriptor_; }
  // One try, which does not wait.
  Claim Try(Kind kind);
  // Turns an exclusive lock into a shared one; for a moment nothing is locked, and another process may
  // come first.
  void Share();
  void Release();

 private:
  int descriptor_;
};

// Locks the folder of a file against others that replace files in it, for as long as the object lives.
// Errors: Busy, NotFound, Io.
Result<FileLock> LockFolderOf(const std::string& path);

}  // namespace cairn
