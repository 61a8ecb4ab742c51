#pragma once

#include "core/line/command.h"

namespace cairn::filter_visibility {

// cairn stage filter-visibility CLASSES -o WORLD
Command FilterVisibilityCommand();

}  // namespace cairn::filter_visibility
