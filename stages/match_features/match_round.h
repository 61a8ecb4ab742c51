#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "core/progress.h"
#include "core/reuse.h"
#include "stages/match_features/image_features.h"
#include "stages/match_features/match_features.h"
#include "stages/match_features/pair_reuse.h"
#include "stages/match_features/predict_pairs.h"

namespace cairn {

// A run of the stage: what it reads, and how far it has come.
struct MatchRun {
  SQLite::Database& features;
  const MatchImages& images;
  const MatchFeaturesOptions& options;
  const ReuseOptions& reuse;
  int num_threads;
  Progress& progress;
  PairKeys keys;
  ReuseSources named;     // reuse.files
  ReuseSources previous;  // the output's earlier state
  std::vector<ReuseEntry> entries;
  MatchFeaturesSummary summary;
};

// Matches the pairs of one round, or takes them over, writes the verified ones to the database in the order
// in which MatchPairs gives them, and tells them to `predictor` (may be null).  Returns whether there may be
// a next round: a shard that finds pairs that no named file has matches its share of these, and then it is
// done; where it finds none it writes nothing.  Errors: those of MatchPairs.
Result<bool> MatchRound(IndexPairs pairs, PairPredictor* predictor, SQLite::Database& database,
                        MatchRun* run);

}  // namespace cairn
