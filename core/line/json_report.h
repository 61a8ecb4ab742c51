#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "core/base/error.h"

namespace cairn {

// Reads the JSON object in a file that a run of the program, or another program, wrote.  Values nested deeper
// than 100 levels are left out: a copy of them would need a frame of the stack for each level.  `what`: what
// the file should be, for the error: "what cairn drive -o wrote".  Errors: those of ReadFile; Corrupt.
Result<nlohmann::ordered_json> ReadJsonReport(const std::string& path, const std::string& what);

}  // namespace cairn
