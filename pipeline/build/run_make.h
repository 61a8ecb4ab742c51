#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/line/command.h"
#include "pipeline/build/make_words.h"

namespace cairn::pipeline {

// map.mk of the program's installation (core/modules/program_files.h).  Errors: NotFound.
Result<std::string> RulesPath(const std::string& program);

// A command line of make that makes `goal` by these rules in this build folder.  `progress_style`: of the
// stages; `variables`: further variables of map.mk.  Errors: InvalidArgument (a path with characters that
// Make cannot handle).
Result<std::vector<std::string>> MakeWords(const std::string& rules, const std::string& build_dir,
                                           const std::string& program, const std::string& goal,
                                           const CommandEnvironment& environment,
                                           const std::string& progress_style, MakeVariables variables = {});

// Runs a program on this one's terminal, with the environment that cairn gives to programs which it starts
// (core/line/child_environment.h) and `variable`; returns its wait status.  When a stop is requested, it asks
// the program to stop and waits for it.  Errors: NotFound, Failed.
Result<int> RunProgramAndWait(const std::vector<std::string>& words, const std::string& variable,
                              const Progress& progress);

}  // namespace cairn::pipeline
