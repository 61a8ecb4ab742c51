#pragma once

#include "core/line/command.h"

namespace cairn::group_classes {

// cairn stage group-classes matches.db --capture CAPTURE -o classes.db
Command GroupClassesCommand();

}  // namespace cairn::group_classes
