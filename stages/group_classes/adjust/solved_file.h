#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "core/base/content_hash.h"
#include "core/files/file_lock.h"

namespace cairn::group_classes {

// The problems that a run has solved so far, in a file beside the stage's output: a run that was stopped, or
// killed, leaves it, and the next one takes the solutions from there and goes on where it stood.  A solution
// is found by the hash of all that it depends on, so the file decides how long a run takes, never what it
// makes: those of another survey are not asked for, and those that are damaged, or of another program, are
// left out.
//
//   "cairn solved 1\n"  16 bytes, with a zero   | the program's identity, with a zero |
//   hash 16 bytes | size u64 | solution | hash of these three, 16 bytes | the next one ...
//
// Solutions are appended when they are there, so that after a kill the last one may be cut off.  A disk that
// is full, or a folder that cannot be written, is a warning: the run goes on without the file, which goes.
class SolvedFile {
 public:
  // Opens the file, or makes it.  Where another process has it, or it cannot be made, nothing is kept.
  explicit SolvedFile(std::string path);

  std::optional<std::string> Find(const ContentHash& problem) const;
  // From any thread.
  void Add(const ContentHash& problem, const std::string& solution);
  // The output is there, or will never be: the file goes.
  void Remove();

 private:
  void Open();
  void Read(const std::string& bytes, const std::string& head);
  void Write(const std::string& bytes);
  void GiveUp(const std::string& what, int error_number);

  std::string path_;
  std::unique_ptr<FileLock> file_;  // null: nothing is kept
  std::map<ContentHash, std::string> found_;
  size_t num_good_bytes_ = 0;
  std::mutex mutex_;
};

// Beside an output: OUTPUT.solved
std::string SolvedPath(const std::string& output_path);

}  // namespace cairn::group_classes
