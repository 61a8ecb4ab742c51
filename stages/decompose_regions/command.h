#pragma once

#include "core/command.h"

namespace cairn {

// cairn decompose-regions WORLD -o OUT
Command DecomposeRegionsCommand();

}  // namespace cairn
