#pragma once

#include "core/command.h"

namespace cairn {

// cairn simulate-worlds --setting 1..4 --seed S -o WORLD
Command SimulateWorldsCommand();

}  // namespace cairn
