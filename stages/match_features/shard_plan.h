#pragma once

#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/line/shard.h"
#include "stages/match_features/match_run.h"

namespace cairn::match_features {

// A plan says what the shards of a round do: so that none of them finds out for itself, from the features
// and matches of the whole survey, what its share is.  It is a database of its own; beside it stands, in
// PLAN.shards, the number of shards that have work, for whoever launches them, and "last" where what follows
// is not worth another plan.

constexpr char kNumShardsSuffix[] = ".shards";

// The number of shards that `num_items` are divided among: each has `min_num_items` at least.  0: the work of
// two is not there, and one alone would do no better than the run that merges.
int NumShardsOf(int64_t num_items, int64_t min_num_items, int num_shards);

// Whether what follows a plan of a run will hardly be divided.  `num_shards`: those that the plan is for;
// `predicts`: whether matches predict other pairs.
bool IsLastPlan(const MatchFeaturesSummary& summary, int num_shards, bool predicts);

// Divides the pairs, each shard a contiguous stretch of them.  REQUIRES: a planning run
void PlanPairs(const IndexPairs& pairs, SQLite::Database& database, MatchRun* run);
// Has the shards compute their shares of an image step.  REQUIRES: a planning run
void PlanImageStep(const std::string& name, int num_shards, SQLite::Database& database, MatchRun* run);

constexpr char kShardPlanSchema[] =
    "CREATE TABLE cairn_shard_plan (num_shards INTEGER NOT NULL, image_step TEXT);"
    "CREATE TABLE cairn_planned_pairs (shard INTEGER PRIMARY KEY NOT NULL, image_ids BLOB NOT NULL);";

// The pairs of a shard, in the order in which they are matched; nothing where shards divide an image step
// among themselves.  Errors: NotFound, Corrupt, Io (the file); InvalidArgument (a plan for another number of
// shards, or of other images).
Result<std::optional<IndexPairs>> ReadPlannedPairs(const std::string& plan_path, const Shard& shard,
                                                   const MatchImages& images);

}  // namespace cairn::match_features
