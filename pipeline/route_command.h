#pragma once

#include "core/command.h"

namespace cairn {

// cairn route: a way from one survey image to another over the map's kept images.
Command RouteCommand();

}  // namespace cairn
