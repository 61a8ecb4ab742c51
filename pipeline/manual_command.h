#pragma once

#include "core/command.h"

namespace cairn {

// `cairn manual -o FOLDER`: manual pages and shell completion of the whole program, for who installs it.
Command ManualCommand();

}  // namespace cairn
