#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "core/command.h"

namespace cairn {

// Environment variable with the path at which a failing command leaves {code, name, stage, message} as JSON:
// make flattens exit codes to 2, so `cairn compile` reads the failed stage's code from there.
inline constexpr const char* kErrorFileVariable = "CAIRN_ERROR_FILE";

// Runs the program: one git-style subcommand of `commands`, each with --threads, --seed, --progress,
// --log-level, --help and --version beside its own arguments.  Results go to `out`, one line per error to
// `err`.  Returns the exit code: 0, 2 for usage, an ErrorCode otherwise.  SIGINT and SIGTERM end the command
// at its next Progress::Cancelled (exit code 10); a second one, more than a second later, ends it at once.
int RunProgram(const std::vector<Command>& commands, int argc, const char* const* argv, std::ostream& out,
               std::ostream& err);

// "0.1.0": the version of the program.
const char* ProgramVersion();

}  // namespace cairn
