#pragma once

#include "core/command.h"

namespace cairn {

// cairn locate-scan VIEWS SCAN [--scan N] [--svg FILE]
Command LocateScanCommand();

}  // namespace cairn
