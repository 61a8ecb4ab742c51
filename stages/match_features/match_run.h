#pragma once

#include <optional>
#include <vector>

#include "core/base/progress.h"
#include "core/line/reuse.h"
#include "core/world/dropped_items.h"
#include "stages/match_features/match_features.h"
#include "stages/match_features/pair_reuse.h"
#include "stages/match_features/pairs/image_features.h"
#include "stages/match_features/prediction_reuse.h"

namespace cairn::match_features {

// A run of the stage: its inputs and its progress.
struct MatchRun {
  SQLite::Database& features;
  const MatchImages& images;
  const MatchFeaturesInputs& inputs;
  const MatchFeaturesOptions& options;
  const ReuseOptions& reuse;
  const PlanOptions* plan;  // of a planning run; otherwise none
  uint64_t seed;
  int num_threads;
  Progress& progress;
  PairKeys keys;
  ReuseSources named;                          // reuse.files
  ReuseSources previous;                       // the output's earlier state
  std::optional<PredictionReuse> predictions;  // where pairs are predicted; a shard has none
  std::optional<IndexPairs> planned;           // what a plan has for the shard
  bool is_planned = false;                     // the plan has been made
  std::vector<ReuseEntry> entries;
  std::vector<DroppedItem> dropped_pairs;  // those tried and not verified
  MatchFeaturesSummary summary;
};

}  // namespace cairn::match_features
