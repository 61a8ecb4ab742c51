#include "stages/match_features/shard_plan.h"

#include <algorithm>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/base/blob.h"

namespace cairn::match_features {
namespace {

// Of what an image costs, about: pairs take less time than features.
constexpr int64_t kPairsPerImage = 16;
// What matches predict is less in each round than in the one before it; the first pairs are as many as the
// images make them.
constexpr int kFirstPredictedRound = 2, kMinNumShardsBeforeAnother = 4;

void WriteNumShards(int num_shards, const std::string& image_step, SQLite::Database& database,
                    MatchRun* run) {
  SQLite::Statement insert(database, "INSERT INTO cairn_shard_plan VALUES (?, ?)");
  insert.bind(1, num_shards);
  if (!image_step.empty()) insert.bind(2, image_step);
  insert.exec();
  run->is_planned = true;
  run->summary.image_step = image_step;
  run->summary.num_shards_with_work = num_shards;
}

Error OtherPlan(const std::string& plan_path, const std::string& found) {
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: {}; plan again, with the features and the number of shards that the shards have",
                   plan_path, found);
}

}  // namespace

int NumShardsOf(int64_t num_items, int64_t min_num_items, int num_shards) {
  const auto num = static_cast<int>(std::min<int64_t>(num_items / min_num_items, num_shards));
  return num < 2 ? 0 : num;
}

bool IsLastPlan(const MatchFeaturesSummary& summary, int num_shards, bool predicts) {
  if (!summary.image_step.empty()) return false;
  const int num_with_work = summary.num_shards_with_work;
  return !predicts || num_with_work == 0 ||
         (summary.num_rounds >= kFirstPredictedRound &&
          num_with_work < std::min(num_shards, kMinNumShardsBeforeAnother));
}

void PlanPairs(const IndexPairs& pairs, SQLite::Database& database, MatchRun* run) {
  const auto num_pairs = static_cast<int64_t>(pairs.size());
  const int num_shards =
      NumShardsOf(num_pairs, kPairsPerImage * run->plan->min_num_images, run->plan->num_shards);
  WriteNumShards(num_shards, "", database, run);
  run->summary.num_left_to_others = num_shards == 0 ? 0 : num_pairs;
  SQLite::Statement insert(database, "INSERT INTO cairn_planned_pairs VALUES (?, ?)");
  for (int index = 1; index <= num_shards; ++index) {
    const auto [begin, end] = ShareOf({index, num_shards}, num_pairs);
    std::vector<ImageId> image_ids;
    for (int64_t i = begin; i < end; ++i) {
      image_ids.push_back(run->images.images[pairs[i].first].image_id);
      image_ids.push_back(run->images.images[pairs[i].second].image_id);
    }
    insert.bind(1, index);
    insert.bind(2, image_ids.data(), static_cast<int>(image_ids.size() * sizeof(ImageId)));
    insert.exec();
    insert.reset();
  }
}

void PlanImageStep(const std::string& name, int num_shards, SQLite::Database& database, MatchRun* run) {
  WriteNumShards(num_shards, name, database, run);
}

Result<std::optional<IndexPairs>> ReadPlannedPairs(const std::string& plan_path, const Shard& shard,
                                                   const MatchImages& images) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(plan_path));
  return WithDatabaseErrors(plan_path, [&]() -> Result<std::optional<IndexPairs>> {
    LimitedStatement plan(database, "SELECT num_shards, image_step FROM cairn_shard_plan");
    if (!plan.executeStep()) return OtherPlan(plan_path, "not a whole plan");
    const int num_shards = plan.getColumn(0).getInt();
    if (num_shards != shard.count) {
      return OtherPlan(plan_path,
                       fmt::format("a plan for {} shards, but this is one of {}", num_shards, shard.count));
    }
    if (!plan.getColumn(1).isNull()) return std::optional<IndexPairs>();
    IndexPairs pairs;
    LimitedStatement query(database, "SELECT image_ids FROM cairn_planned_pairs WHERE shard = ?");
    query.bind(1, shard.index);
    if (!query.executeStep()) return std::optional(std::move(pairs));  // it has no work
    CAIRN_ASSIGN_OR_RETURN(const std::vector<ImageId> image_ids,
                           BlobToVector<ImageId>(query.getColumn(0), plan_path));
    std::unordered_map<ImageId, int> idxs;
    for (size_t i = 0; i < images.images.size(); ++i)
      idxs.emplace(images.images[i].image_id, static_cast<int>(i));
    for (size_t i = 0; i + 1 < image_ids.size(); i += 2) {
      const auto first = idxs.find(image_ids[i]), second = idxs.find(image_ids[i + 1]);
      if (first == idxs.end() || second == idxs.end() || first->second >= second->second) {
        return OtherPlan(plan_path, fmt::format("images {} and {} are no pair of the features'", image_ids[i],
                                                image_ids[i + 1]));
      }
      pairs.emplace_back(first->second, second->second);
    }
    IndexPairs sorted = pairs;
    std::sort(sorted.begin(), sorted.end());
    if (image_ids.size() % 2 != 0 || std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
      return OtherPlan(plan_path, "not a list of different pairs");
    return std::optional(std::move(pairs));
  });
}

}  // namespace cairn::match_features
