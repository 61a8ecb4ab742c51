#pragma once

#include <string>

#include "core/error.h"
#include "pipeline/recipe.h"

namespace cairn {

// Where a recipe is compiled to and by what; all paths absolute.
struct BuildPaths {
  std::string build_dir;  // the build folder: options, stage files, stamps
  std::string map;        // NAME.cairn
  std::string program;    // cairn
};

// Errors: InvalidArgument when a path has characters that Make cannot carry: white space and
// $#%:;&|<>()[]*?'"`\=!
Status CheckMakePath(const std::string& what, const std::string& path);

// Whether the capture has no poses of its own: then `reconstruct` finds them.
bool IsReconstructed(const Recipe& recipe);

// Splits a recipe into the files that map.mk's rules depend on, each rewritten only when its content changes:
//   options/STAGE.toml    every option of the stage, in canonical form (OptionsToml)
//   options/seed, name, capture, queries    one value each
//   options/program       hash of the program: another one redoes every stage, whatever its date
//   config.mk             MAP, CAPTURE, SIMULATED, RECONSTRUCTED, KNOWN_PLACES, QUERIES, NAME, SEED and
//                         PROGRAM for map.mk
// Errors: InvalidArgument (CheckMakePath), NotFound (a file that [reconstruct] names), Io.
Status WriteBuildFolder(const Recipe& recipe, const BuildPaths& paths);

// Removes temporary files that killed runs left in the folder.  REQUIRES: the folder is locked.
void RemoveStaleTemporaries(const std::string& build_dir);

// Holds a folder for one compile at a time, as long as the object lives.  Child processes inherit the lock:
// it also lasts as long as a stage that a killed compile left behind.
class FolderLock {
 public:
  // Errors: Busy (says which process has it), Io.
  static Result<FolderLock> Acquire(const std::string& build_dir);
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&&) = delete;
  ~FolderLock();

 private:
  explicit FolderLock(int fd) : fd_(fd) {}
  int fd_;
};

}  // namespace cairn
