#pragma once

#include "core/line/command.h"

namespace cairn::decompose_regions {

// cairn stage decompose-regions WORLD -o OUT
Command DecomposeRegionsCommand();
// cairn stage check-regions WORLD REGIONS
Command CheckRegionsCommand();

}  // namespace cairn::decompose_regions
