#pragma once

#include "core/line/command.h"

namespace cairn::match_features {

// cairn match-features features.db [--capture CAPTURE] -o matches.db
Command MatchFeaturesCommand();

}  // namespace cairn::match_features
