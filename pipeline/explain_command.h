#pragma once

#include "core/command.h"

namespace cairn {

// cairn explain MAP [--at X,Y[,HEADING] | --image NAME] [--build-dir DIR] [--json]
Command ExplainCommand();

}  // namespace cairn
