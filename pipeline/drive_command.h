#pragma once

#include "core/command.h"

namespace cairn {

// cairn drive: a lost robot goes to a survey image in a simulated building.
Command DriveCommand();

}  // namespace cairn
