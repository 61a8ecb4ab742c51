#pragma once

#include "core/command.h"

namespace cairn {

// cairn pareto RECIPE.toml -o NAME.cairn [--sizes BYTES,...]
Command ParetoCommand();

}  // namespace cairn
