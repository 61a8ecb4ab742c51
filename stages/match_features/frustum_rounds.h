#pragma once

#include <string>

#include "core/base/error.h"
#include "stages/match_features/match_run.h"

namespace cairn::match_features {

// Matches the pairs of largest overlap, then repeatedly those that the matches so far predict, and writes
// them to the database; of a shard or a plan the first of these steps that named files do not have whole.
// Errors: InvalidArgument (an image without a pose), Cancelled; those of the steps.
Status MatchFrustum(const std::string& matches_path, SQLite::Database& database, MatchRun* run);

}  // namespace cairn::match_features
