#pragma once

#include "core/command.h"

namespace cairn {

// `cairn simulate RECIPE.toml -o CAPTURE`
Command SimulateCommand();

}  // namespace cairn
