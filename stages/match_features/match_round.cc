#include "stages/match_features/match_round.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "stages/match_features/shard_plan.h"

namespace cairn::match_features {
namespace {

Error Stopped() { return MakeError(ErrorCode::kCancelled, "stopped while taking over matches"); }

std::optional<PairResult> FindIn(const std::vector<ReuseSources*>& sources, const ContentHash& key,
                                 const std::pair<int, int>& pair, const MatchRun& run) {
  for (ReuseSources* const source : sources) {
    auto result = FindPairResult(key, run.images.images[pair.first], run.images.images[pair.second], source);
    if (result) return result;
  }
  return std::nullopt;
}

// What is found while it is asked which pairs are missing is held until it is taken over, as far as it fits
// into this part of the memory that features may take, the first pairs first; the others are read again.
constexpr double kHeldRatio = 0.5;

struct Found {
  std::vector<size_t> missing;   // indices of the pairs that no source has
  std::vector<PairResult> held;  // of the first pairs, empty where one is missing
};

Result<Found> FindPairs(const IndexPairs& pairs, const std::vector<ReuseSources*>& sources, MatchRun* run) {
  Found found;
  if (std::all_of(sources.begin(), sources.end(),
                  [](const ReuseSources* source) { return source->empty(); })) {
    found.missing.resize(pairs.size());
    std::iota(found.missing.begin(), found.missing.end(), 0);
    return found;
  }
  const double max_num_bytes = kHeldRatio * (1 << 20) * run->options.matching.memory_budget_mib;
  double num_bytes = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (run->progress.Cancelled()) return Stopped();
    CAIRN_ASSIGN_OR_RETURN(const ContentHash key, run->keys.Of(pairs[i]));
    std::optional<PairResult> result = FindIn(sources, key, pairs[i], *run);
    if (!result) found.missing.push_back(i);
    if (num_bytes > max_num_bytes) continue;
    found.held.push_back(std::move(result).value_or(PairResult()));
    num_bytes +=
        static_cast<double>(sizeof(PairResult) + found.held.back().geometry.inliers.size() * sizeof(Match));
  }
  return found;
}

void TellPredictor(const std::pair<int, int>& pair, const PairResult& result, PairPredictor* predictor) {
  if (predictor != nullptr) predictor->Add(pair.first, pair.second, result.geometry.inliers);
}

// Why a pair was not verified.
DropReason ReasonOf(const PairResult& result, const VerifyPairOptions& options) {
  if (result.geometry.config == TwoViewConfig::kWatermark) return DropReason::kWatermark;
  return result.num_putative < options.min_num_inliers ? DropReason::kFewMatches : DropReason::kFewInliers;
}

Status TakeResult(const std::pair<int, int>& pair, const PairResult& result, PairPredictor* predictor,
                  SQLite::Database& database, MatchRun* run) {
  CAIRN_ASSIGN_OR_RETURN(const ContentHash key, run->keys.Of(pair));
  run->entries.push_back(EntryOf(key, result));
  if (run->predictions) run->predictions->Add(pair, run->entries.back().contents);
  MatchFeaturesSummary& summary = run->summary;
  ++summary.num_pairs_tried;
  summary.num_putative += result.num_putative;
  if (result.geometry.inliers.empty()) {
    const DropReason reason = ReasonOf(result, run->options.matching.verification);
    ++summary.dropped_pairs[DescribeDropReason(reason).name];
    run->dropped_pairs.push_back(
        {.reason = reason,
         .item_id = PairIdFromImageIds(result.geometry.image_id1, result.geometry.image_id2),
         .found = result.num_putative});
    return Ok();
  }
  WriteDatabaseTwoViewGeometry(database, result.geometry);
  ++summary.num_pairs_verified;
  summary.num_inliers += static_cast<int64_t>(result.geometry.inliers.size());
  TellPredictor(pair, result, predictor);
  return Ok();
}

// Hands pairs [begin, end), which the sources have, to `take`.  `held`: what is held of the first pairs; it
// is given up.
template <typename Take>
Status TakeOver(const IndexPairs& pairs, size_t begin, size_t end, const std::vector<ReuseSources*>& sources,
                std::vector<PairResult>* held, MatchRun* run, const Take& take) {
  for (size_t i = begin; i < end; ++i) {
    if (run->progress.Cancelled()) return Stopped();
    if (i < held->size()) {
      CAIRN_RETURN_IF_ERROR(take(pairs[i], std::exchange((*held)[i], PairResult())));
      continue;
    }
    CAIRN_ASSIGN_OR_RETURN(const ContentHash key, run->keys.Of(pairs[i]));
    const auto result = FindIn(sources, key, pairs[i], *run);
    if (!result) {
      return MakeError(ErrorCode::kIo,
                       "an earlier output changed while its matches were taken over; run it again");
    }
    CAIRN_RETURN_IF_ERROR(take(pairs[i], *result));
  }
  return Ok();
}

// All results are written to the database in the order of `pairs`, so that its bytes do not depend on which
// were taken over.
Status WritePairs(const IndexPairs& pairs, const std::vector<ReuseSources*>& sources,
                  PairPredictor* predictor, SQLite::Database& database, MatchRun* run) {
  CAIRN_ASSIGN_OR_RETURN(Found found, FindPairs(pairs, sources, run));
  const std::vector<size_t>& missing = found.missing;
  run->summary.num_taken_over += static_cast<int64_t>(pairs.size() - missing.size());
  const auto take_result = [&](const std::pair<int, int>& pair, const PairResult& result) {
    return TakeResult(pair, result, predictor, database, run);
  };
  size_t num_taken = 0, num_computed = 0;
  if (!missing.empty()) {
    IndexPairs to_match;
    for (const size_t i : missing) to_match.push_back(pairs[i]);
    Status status;
    const auto take = [&](const TwoViewGeometry& geometry, int num_putative) {
      const size_t i = missing[num_computed++];
      if (status.ok()) status = TakeOver(pairs, num_taken, i, sources, &found.held, run, take_result);
      if (status.ok()) status = take_result(pairs[i], {geometry, num_putative});
      num_taken = i + 1;
    };
    run->progress.Begin("match features", static_cast<int64_t>(to_match.size()), "pairs");
    CAIRN_RETURN_IF_ERROR(MatchPairs(run->features, run->images, std::move(to_match), run->options.matching,
                                     run->num_threads, run->progress, take));
    run->progress.End();
    CAIRN_RETURN_IF_ERROR(status);
  }
  return TakeOver(pairs, num_taken, pairs.size(), sources, &found.held, run, take_result);
}

}  // namespace

Result<bool> MatchRound(IndexPairs pairs, PairPredictor* predictor, SQLite::Database& database,
                        MatchRun* run) {
  SortAlongCurve(&pairs);
  ++run->summary.num_rounds;
  if (!run->reuse.shard && run->plan == nullptr) {
    CAIRN_RETURN_IF_ERROR(WritePairs(pairs, {&run->named, &run->previous}, predictor, database, run));
    return true;
  }
  CAIRN_ASSIGN_OR_RETURN(Found found, FindPairs(pairs, {&run->named}, run));
  if (found.missing.empty()) {
    CAIRN_RETURN_IF_ERROR(TakeOver(pairs, 0, pairs.size(), {&run->named}, &found.held, run,
                                   [&](const std::pair<int, int>& pair, const PairResult& result) {
                                     TellPredictor(pair, result, predictor);
                                     if (run->predictions)
                                       run->predictions->Add(pair, EntryOf({}, result).contents);
                                     return Ok();
                                   }));
    return true;
  }
  IndexPairs missing;
  for (const size_t i : found.missing) missing.push_back(pairs[i]);
  if (run->plan != nullptr) {
    PlanPairs(missing, database, run);
    return false;
  }
  const auto [begin, end] = ShareOf(*run->reuse.shard, static_cast<int64_t>(missing.size()));
  const IndexPairs share(missing.begin() + begin, missing.begin() + end);
  run->summary.num_left_to_others = static_cast<int64_t>(missing.size() - share.size());
  CAIRN_RETURN_IF_ERROR(WritePairs(share, {&run->previous}, nullptr, database, run));
  return false;
}

Status MatchPlanned(const IndexPairs& pairs, SQLite::Database& database, MatchRun* run) {
  return WritePairs(pairs, {&run->previous}, nullptr, database, run);
}

}  // namespace cairn::match_features
