#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "core/line/command.h"

namespace cairn::pipeline {

// Runs the program: one command of `commands`, each with --threads, --memory, --seed, --progress,
// --log-level, --report, --stamp, --help and --version besides its own arguments.  Results go to `out`, one
// line per error to `err`; in both, characters that would control a terminal are shown instead
// (core/base/printable.h).  Returns the exit code: 0, 2 for usage, an ErrorCode otherwise.  SIGINT and
// SIGTERM end the command at its next Progress::Cancelled (exit code 10); a second one, more than a second
// later, ends it at once.
int RunProgram(const std::vector<Command>& commands, int argc, const char* const* argv, std::ostream& out,
               std::ostream& err);

}  // namespace cairn::pipeline
