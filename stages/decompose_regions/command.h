#pragma once

#include "core/command.h"

namespace cairn {

// cairn decompose-regions WORLD -o OUT
Command DecomposeRegionsCommand();
// cairn check-regions WORLD REGIONS
Command CheckRegionsCommand();

}  // namespace cairn
