#pragma once

#include "core/line/command.h"

namespace cairn::sim {

// cairn stage simulate-worlds --setting 1..4 --seed S -o WORLD
Command SimulateWorldsCommand();

}  // namespace cairn::sim
