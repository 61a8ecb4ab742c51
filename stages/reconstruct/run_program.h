#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"

namespace cairn::reconstruct {

// How a program of somebody else is run.
struct RunProgramOptions {
  // "NAME=VALUE", added to what programs get that cairn starts (core/line/child_environment.h).
  std::vector<std::string> environment;
  double max_seconds = 0;  // then it is ended; 0: no limit
  int num_last_lines = 12;
  // Gets every line that it writes on either output, without the line's end.
  std::function<void(const std::string&)> on_line;
};

struct ProgramOutcome {
  int exit_code = 0;  // 128 + N: ended by signal N
  bool timed_out = false;
  std::vector<std::string> last_lines;  // those that say something
  bool succeeded() const { return exit_code == 0 && !timed_out; }
};

// Runs words[0], looked for on PATH, with the other words as arguments and nothing on its input, and waits
// for it.  It runs in a process group of its own, which is ended as a whole (SIGTERM, two seconds later
// SIGKILL) past its time and when progress.Cancelled().
// Errors: NotFound (no such program), Io, Cancelled.
Result<ProgramOutcome> RunProgram(const std::vector<std::string>& words, const RunProgramOptions& options,
                                  const Progress& progress);

}  // namespace cairn::reconstruct
