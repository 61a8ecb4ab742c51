#pragma once

#include "core/line/command.h"

namespace cairn::simulate {

// `cairn stage simulate RECIPE.toml -o CAPTURE`
Command SimulateCommand();

}  // namespace cairn::simulate
