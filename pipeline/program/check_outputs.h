#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/base/error.h"

namespace cairn::pipeline {

// Refuses outputs of a parsed command that would overwrite one of its other arguments: the same file under
// any name, a list or an image of a capture, or a folder that is replaced and has an input inside.
// `may_be_output`: names of arguments that are not such inputs (Command::may_be_output).
// Errors: InvalidArgument.
Status CheckOutputs(const CLI::App& command, const std::vector<std::string>& may_be_output);

}  // namespace cairn::pipeline
