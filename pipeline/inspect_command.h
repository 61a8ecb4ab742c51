#pragma once

#include "core/command.h"

namespace cairn {

// cairn inspect MAP [--json] [--svg FILE]: what is in a map, and what it costs.
Command InspectCommand();

}  // namespace cairn
