#pragma once

#include "core/command.h"

namespace cairn {

// cairn report MAP -o report.html
Command ReportCommand();

}  // namespace cairn
