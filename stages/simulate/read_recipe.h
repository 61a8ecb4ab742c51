#pragma once

#include <cstdint>
#include <string>

#include "core/error.h"
#include "stages/simulate/options.h"

namespace cairn {

// Takes options and seed from a recipe's [simulate] table, or the options from a file that holds only such a
// table's keys.  Other tables are other stages'.  Errors: NotFound, Corrupt, InvalidArgument (a recipe
// without the table; keys and values).
Status ReadSimulateRecipe(const std::string& path, SimulateOptions* options, uint64_t* seed);

}  // namespace cairn
