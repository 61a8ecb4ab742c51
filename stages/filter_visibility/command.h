#pragma once

#include "core/command.h"

namespace cairn {

// cairn filter-visibility CLASSES -o WORLD
Command FilterVisibilityCommand();

}  // namespace cairn
