#pragma once

#include "core/base/error.h"
#include "stages/match_features/match_run.h"
#include "stages/match_features/pairs/predict_pairs.h"

namespace cairn::match_features {

// Matches the pairs of one round, or takes them over, writes the verified ones to the database in the order
// in which MatchPairs gives them, and adds them to `predictor` (may be null).  Returns whether there may be a
// next round: a shard that finds pairs that no named file has matches its share of these and is then done,
// and a plan divides them; where they find none they write nothing.  Errors: those of MatchPairs.
Result<bool> MatchRound(IndexPairs pairs, PairPredictor* predictor, SQLite::Database& database,
                        MatchRun* run);

// Matches the pairs that a plan has for a shard.
Status MatchPlanned(const IndexPairs& pairs, SQLite::Database& database, MatchRun* run);

}  // namespace cairn::match_features
