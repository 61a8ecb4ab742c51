#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"

namespace cairn::reconstruct {

// Options for running another program.
struct RunProgramOptions {
  // "NAME=VALUE", added to the environment of programs that cairn starts (core/line/child_environment.h).
  std::vector<std::string> environment;
  double max_seconds = 0;  // time limit after which it is ended; 0: no limit
  int num_last_lines = 12;
  // Gets every line that it writes on either output, without the line's end.
  std::function<void(const std::string&)> on_line;
};

struct ProgramOutcome {
  int exit_code = 0;  // 128 + N: ended by signal N
  bool timed_out = false;
  std::vector<std::string> last_lines;  // without empty ones
  bool succeeded() const { return exit_code == 0 && !timed_out; }
};

// Runs words[0], searched on PATH, with the other words as arguments and an empty input, and waits for it.
// It runs in its own process group, which is ended as a whole (SIGTERM, two seconds later SIGKILL) after its
// time limit and when progress.Cancelled().  Errors: NotFound (no such program), Io, Cancelled.
Result<ProgramOutcome> RunProgram(const std::vector<std::string>& words, const RunProgramOptions& options,
                                  const Progress& progress);

}  // namespace cairn::reconstruct
