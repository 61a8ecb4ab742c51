#pragma once

#include "core/command.h"

namespace cairn {

// `cairn clean`: removes what compiles left in a build folder, and nothing that somebody else put there.
Command CleanCommand();

}  // namespace cairn
