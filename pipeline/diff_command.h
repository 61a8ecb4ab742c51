#pragma once

#include "core/command.h"

namespace cairn {

// cairn diff A B [--json]
Command DiffCommand();

}  // namespace cairn
