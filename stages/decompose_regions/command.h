#pragma once

#include "core/line/command.h"

namespace cairn::decompose_regions {

// cairn decompose-regions WORLD -o OUT
Command DecomposeRegionsCommand();
// cairn check-regions WORLD REGIONS
Command CheckRegionsCommand();

}  // namespace cairn::decompose_regions
