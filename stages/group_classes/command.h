#pragma once

#include "core/command.h"

namespace cairn {

// cairn group-classes matches.db --capture CAPTURE -o classes.db
Command GroupClassesCommand();

}  // namespace cairn
