#pragma once

#include <string>
#include <vector>

#include "core/error.h"

namespace cairn {

// Whether two paths lead to one file, under whichever names.
bool IsSameFile(const std::string& path1, const std::string& path2);

// Errors: InvalidArgument when an output is one of the inputs, under whichever name: it would be lost. Inputs
// that are empty or do not exist do not matter.
Status CheckOutputIsNoInput(const std::string& output, const std::vector<std::string>& inputs);

}  // namespace cairn
