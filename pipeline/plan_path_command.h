#pragma once

#include "core/command.h"

namespace cairn {

// cairn plan-path VIEWS --from X,Y [--to X,Y] [--kind short|min-link|search] [--svg FILE]
Command PlanPathCommand();
// cairn tell-apart VIEWS --a X,Y,DEG --b X,Y,DEG [--svg FILE]
Command TellApartCommand();

}  // namespace cairn
