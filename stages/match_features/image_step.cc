#include "stages/match_features/image_step.h"

#include <algorithm>
#include <numeric>
#include <string_view>
#include <utility>

#include "stages/match_features/shard_plan.h"

namespace cairn::match_features {
namespace {

constexpr char kSchema[] =
    "CREATE TABLE IF NOT EXISTS cairn_image_steps (idx INTEGER PRIMARY KEY NOT NULL, numbers BLOB)";
// An image costs less here than where its features are found.
constexpr int64_t kImagesPerImage = 8;

std::string_view BytesOf(const std::vector<int>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(int)};
}

std::optional<std::vector<int>> FindNumbers(const ImageStep& step, const ContentHash& key,
                                            ReuseSources* sources) {
  return sources->Find(key, [&](const ReuseEntry& entry, ReuseSources::Source& source) {
    std::optional<std::vector<int>> numbers;
    SQLite::Statement query(source.Database(), "SELECT numbers FROM cairn_image_steps WHERE idx = ?");
    query.bind(1, entry.row);
    if (!query.executeStep()) return numbers;
    auto found = BlobToVector<int>(query.getColumn(0), source.path());
    if (found.ok() && HashContents(BytesOf(*found)) == entry.contents && step.is_valid(*found))
      numbers = std::move(*found);
    return numbers;
  });
}

// Computes the results of `idxs` and stores them at their places.
Status Compute(const ImageStep& step, const std::vector<int>& idxs, std::vector<std::vector<int>>* results) {
  if (idxs.empty()) return Ok();
  CAIRN_ASSIGN_OR_RETURN(std::vector<std::vector<int>> computed, step.compute(idxs));
  for (size_t i = 0; i < idxs.size(); ++i) (*results)[idxs[i]] = std::move(computed[i]);
  return Ok();
}

// Those of `idxs` that the sources lack; the others' results are put into their places.
Result<std::vector<int>> FindMissing(const ImageStep& step, const std::vector<int>& idxs,
                                     ReuseSources* sources, std::vector<std::vector<int>>* results) {
  if (sources->empty()) return idxs;
  std::vector<int> missing;
  for (const int idx : idxs) {
    CAIRN_ASSIGN_OR_RETURN(const ContentHash key, step.key(idx));
    if (auto numbers = FindNumbers(step, key, sources)) {
      (*results)[idx] = std::move(*numbers);
    } else {
      missing.push_back(idx);
    }
  }
  return missing;
}

Status WriteResults(const ImageStep& step, const std::vector<int>& idxs,
                    const std::vector<std::vector<int>>& results, SQLite::Database& database, MatchRun* run) {
  database.exec(kSchema);
  SQLite::Statement insert(database, "INSERT INTO cairn_image_steps (numbers) VALUES (?)");
  for (const int idx : idxs) {
    CAIRN_ASSIGN_OR_RETURN(const ContentHash key, step.key(idx));
    const std::string_view bytes = BytesOf(results[idx]);
    insert.bind(1, bytes.data(), static_cast<int>(bytes.size()));
    insert.exec();
    insert.reset();
    run->entries.push_back(
        {.key = key, .contents = HashContents(bytes), .row = database.getLastInsertRowid()});
  }
  return Ok();
}

}  // namespace

bool AreBelow(std::span<const int> numbers, int end) {
  return std::all_of(numbers.begin(), numbers.end(),
                     [end](int number) { return 0 <= number && number < end; });
}

Result<std::optional<std::vector<std::vector<int>>>> RunImageStep(const ImageStep& step,
                                                                  SQLite::Database* database, MatchRun* run) {
  std::vector<std::vector<int>> results(run->images.images.size());
  std::vector<int> all(results.size());
  std::iota(all.begin(), all.end(), 0);
  CAIRN_ASSIGN_OR_RETURN(const std::vector<int> missing, FindMissing(step, all, &run->named, &results));
  const auto num_missing = static_cast<int64_t>(missing.size());
  const int num_shards =
      run->plan == nullptr
          ? 0
          : NumShardsOf(num_missing, kImagesPerImage * run->plan->min_num_images, run->plan->num_shards);
  if (num_shards > 0) {
    PlanImageStep(step.name, num_shards, *database, run);
    run->summary.num_left_to_others = num_missing;
    return std::optional<std::vector<std::vector<int>>>();
  }
  if (missing.empty() || !run->reuse.shard) {
    CAIRN_RETURN_IF_ERROR(Compute(step, missing, &results));
    if (run->plan != nullptr) CAIRN_RETURN_IF_ERROR(WriteResults(step, missing, results, *database, run));
    return std::optional(std::move(results));
  }
  const auto [begin, end] = ShareOf(*run->reuse.shard, num_missing);
  const std::vector<int> share(missing.begin() + begin, missing.begin() + end);
  CAIRN_ASSIGN_OR_RETURN(const std::vector<int> to_compute,
                         FindMissing(step, share, &run->previous, &results));
  CAIRN_RETURN_IF_ERROR(Compute(step, to_compute, &results));
  CAIRN_RETURN_IF_ERROR(WriteResults(step, share, results, *database, run));
  run->summary.image_step = step.name;
  run->summary.num_image_results = static_cast<int>(share.size());
  run->summary.num_taken_over = static_cast<int64_t>(share.size() - to_compute.size());
  run->summary.num_left_to_others = num_missing - std::ssize(share);
  return std::optional<std::vector<std::vector<int>>>();
}

}  // namespace cairn::match_features
