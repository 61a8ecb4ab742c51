#pragma once

#include "core/line/command.h"

namespace cairn::match_features {

// cairn stage match-features features.db [--capture CAPTURE] -o matches.db
Command MatchFeaturesCommand();

}  // namespace cairn::match_features
