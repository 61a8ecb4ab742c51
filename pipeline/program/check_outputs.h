#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/base/error.h"

namespace cairn::pipeline {

// Refuses to write what a subcommand, parsed, would write over one of its other arguments: the same file
// under whichever name, a list or an image of a capture, a folder that is replaced with an input inside.
// `may_be_output`: names of arguments that are no such inputs (Command::may_be_output).
// Errors: InvalidArgument.
Status CheckOutputs(const CLI::App& subcommand, const std::vector<std::string>& may_be_output);

}  // namespace cairn::pipeline
