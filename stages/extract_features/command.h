#pragma once

#include "core/command.h"

namespace cairn {

// cairn extract-features CAPTURE -o features.db [--depfile FILE.d]
Command ExtractFeaturesCommand();

}  // namespace cairn
