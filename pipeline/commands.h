#pragma once

#include <vector>

#include "core/command.h"

namespace cairn {

// Every subcommand of the program, the line's stages first and in its order.
std::vector<Command> AllCommands();

}  // namespace cairn
