#pragma once

#include "core/command.h"

namespace cairn {

// cairn match-features features.db [--capture CAPTURE] -o matches.db
Command MatchFeaturesCommand();

}  // namespace cairn
