#pragma once

#include "core/line/command.h"

namespace cairn::extract_features {

// cairn stage extract-features CAPTURE -o features.db [--depfile FILE.d]
Command ExtractFeaturesCommand();

}  // namespace cairn::extract_features
