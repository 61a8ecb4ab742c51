#pragma once

#include "core/line/command.h"

namespace cairn::filter_visibility {

// cairn filter-visibility CLASSES -o WORLD
Command FilterVisibilityCommand();

}  // namespace cairn::filter_visibility
