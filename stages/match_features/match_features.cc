#include "stages/match_features/match_features.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "core/base/text.h"
#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "core/world/dropped_items.h"
#include "stages/match_features/frustum_rounds.h"
#include "stages/match_features/match_round.h"
#include "stages/match_features/pairs/pair_list.h"
#include "stages/match_features/partners_by_looks.h"
#include "stages/match_features/shard_plan.h"

namespace cairn::match_features {
namespace {

// How pairs are chosen: options.pairs, "auto" resolved.
std::string ChooseMethod(const MatchImages& images, const MatchFeaturesOptions& options) {
  if (options.pairs != "auto") return options.pairs;
  if (images.AllPosed()) return "frustum";
  const int num_images = static_cast<int>(images.images.size());
  return num_images <= options.max_num_exhaustive_images ? "exhaustive" : "retrieval";
}

// Each image with its neighbours in the order of names, and with loop candidates.
Result<std::optional<IndexPairs>> SelectSequencePairs(SQLite::Database* database, MatchRun* run) {
  const MatchFeaturesOptions& options = run->options;
  std::vector<std::string> names;
  for (const MatchImage& image : run->images.images) names.push_back(image.name);
  const std::vector<int> order = NaturalOrder(names);
  IndexPairs pairs = SequencePairs(order, options.sequence_window);
  if (options.num_loop_candidates == 0) return std::optional(std::move(pairs));
  ContentHasher key;
  key.Text("loops").UInt(options.sequence_window).UInt(options.num_loop_candidates);
  for (const int idx : order) key.UInt(idx);
  const LooksRule rule = {.key = key.Finish(),
                          .partners = [&](const ImageSimilarity& similarity, const std::vector<int>& idxs) {
                            return LoopPartners(similarity, idxs, order, options.sequence_window,
                                                options.num_loop_candidates, run->num_threads);
                          }};
  CAIRN_ASSIGN_OR_RETURN(const auto partners, PartnersByLooks(rule, database, run));
  if (!partners) return std::optional<IndexPairs>();
  const IndexPairs loops = PairsFromPartners(*partners);
  pairs.insert(pairs.end(), loops.begin(), loops.end());
  std::sort(pairs.begin(), pairs.end());
  return std::optional(std::move(pairs));
}

Result<std::optional<IndexPairs>> SelectRetrievedPairs(SQLite::Database* database, MatchRun* run) {
  const int num_retrieved = run->options.num_retrieved;
  const LooksRule rule = {.key = ContentHasher().Text("retrieved").UInt(num_retrieved).Finish(),
                          .partners = [&](const ImageSimilarity& similarity, const std::vector<int>& idxs) {
                            return RetrievedPartners(similarity, idxs, num_retrieved, run->num_threads);
                          }};
  CAIRN_ASSIGN_OR_RETURN(const auto partners, PartnersByLooks(rule, database, run));
  if (!partners) return std::optional<IndexPairs>();
  return std::optional(PairsFromPartners(*partners));
}

// Pairs by every method but frustum.  Nothing where the run is a shard that has computed its share of
// choosing them and written it to its database, or a plan that has left it to shards.
Result<std::optional<IndexPairs>> SelectPairs(SQLite::Database* database, MatchRun* run) {
  const std::string& method = run->summary.pairs;
  if (method == "list") {
    CAIRN_ASSIGN_OR_RETURN(PairList list, ReadPairList(run->inputs.pair_list_path, run->images));
    return std::optional(std::move(list.pairs));
  }
  if (method == "exhaustive")
    return std::optional(ExhaustivePairs(static_cast<int>(run->images.images.size())));
  return method == "sequence" ? SelectSequencePairs(database, run) : SelectRetrievedPairs(database, run);
}

Status CheckRanges(const MatchFeaturesOptions& options) {
  if (options.frustum.near_m >= options.frustum.far_m) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "frustum_near_m = {:g} must be less than frustum_far_m = {:g}", options.frustum.near_m,
                     options.frustum.far_m);
  }
  const VerifyPairOptions& verification = options.matching.verification;
  if (verification.max_prior_error_px < verification.max_epipolar_error_px) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "max_prior_error_px = {:g} must be at least max_epipolar_error_px = {:g}",
                     verification.max_prior_error_px, verification.max_epipolar_error_px);
  }
  if (options.matching.memory_budget_mib < 1) {
    return MakeError(ErrorCode::kInvalidArgument, "a memory budget of {} MiB; expected at least 1",
                     options.matching.memory_budget_mib);
  }
  return Ok();
}

// What the stage keeps of an image and of its pairs beside features, for as long as it runs: up to 100 pairs
// an image, as images of a lattice have that see hundreds of others.
constexpr int64_t kKeptBytesPerImage = int64_t{16} << 10;
// Features have at least this part of the memory.
constexpr double kMinFeaturesRatio = 0.25;

// The options with what is left of the memory for features.
MatchFeaturesOptions WithMemoryForFeatures(MatchFeaturesOptions options, size_t num_images) {
  int& budget_mib = options.matching.memory_budget_mib;
  const auto kept_mib = static_cast<int>((static_cast<int64_t>(num_images) * kKeptBytesPerImage) >> 20);
  budget_mib = std::max({1, static_cast<int>(kMinFeaturesRatio * budget_mib), budget_mib - kept_mib});
  return options;
}

// A new list of what was dropped, with the images that have no features.
void ReplaceDroppedItems(const MatchImages& images, SQLite::Database& database) {
  database.exec(
      fmt::format("DROP TABLE IF EXISTS {}; {}", kColmapDroppedItemsTable, kColmapDroppedItemsSchema));
  std::vector<DroppedItem> items;
  for (const auto& [name, image_id] : images.without_features)
    items.push_back({.reason = DropReason::kNoFeatures, .item_id = image_id});
  WriteDroppedItems(database, kColmapDroppedItemsTable, items);
}

// The database of the features, with the verified pairs.
Status WriteMatches(const std::string& matches_path, MatchRun* run) {
  const std::string& features_path = run->inputs.features_path;
  IndexPairs pairs;
  if (run->summary.pairs != "frustum") {
    auto selected = WithDatabaseErrors(features_path, [&] { return SelectPairs(nullptr, run); });
    if (!selected.ok()) return selected.error();
    pairs = std::move(selected).value().value();
  }
  return ReplaceFileAtomically(matches_path, [&](const std::string& temporary) -> Status {
    return WithDatabaseErrors(temporary, [&]() -> Status {
      CopyColmapDatabase(run->features, temporary);
      SQLite::Database database = OpenPrivate(temporary);
      database.exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF");
      Harden(database, UINT64_MAX);  // it has the triggers and views of the features' database, if any
      database.exec("BEGIN; DELETE FROM two_view_geometries");
      ReplaceDroppedItems(run->images, database);
      if (run->summary.pairs == "frustum") {
        CAIRN_RETURN_IF_ERROR(MatchFrustum(matches_path, database, run));
      } else {
        CAIRN_RETURN_IF_ERROR(MatchRound(std::move(pairs), nullptr, database, run));
      }
      WriteDroppedItems(database, kColmapDroppedItemsTable, run->dropped_pairs);
      if (run->summary.num_pairs_verified == 0) {
        return MakeError(
            ErrorCode::kNoData,
            "{}: none of {} pairs ({}) has {} verified matches; do the images overlap, and do the poses fit?",
            features_path, run->summary.num_pairs_tried, run->summary.pairs,
            run->options.matching.verification.min_num_inliers);
      }
      database.exec("COMMIT");
      return Ok();
    });
  });
}

// The pairs of one round after the other, or what is to be known before, as far as a shard or a plan goes.
Status GoThroughRounds(const std::string& matches_path, SQLite::Database& database, MatchRun* run) {
  if (run->images.images.size() < 2) return Ok();
  if (run->summary.pairs == "frustum") return MatchFrustum(matches_path, database, run);
  CAIRN_ASSIGN_OR_RETURN(std::optional<IndexPairs> pairs, SelectPairs(&database, run));
  if (pairs) CAIRN_RETURN_IF_ERROR(MatchRound(std::move(*pairs), nullptr, database, run));
  return Ok();
}

// Only the shard's results, without features.
Status WriteShard(const std::string& matches_path, MatchRun* run) {
  return WriteDatabase(matches_path, kColmapSchema, [&](SQLite::Database& database) -> Status {
    return run->planned ? MatchPlanned(*run->planned, database, run)
                        : GoThroughRounds(matches_path, database, run);
  });
}

Status WritePlan(const std::string& plan_path, MatchRun* run) {
  CAIRN_RETURN_IF_ERROR(WriteDatabase(plan_path, kShardPlanSchema, [&](SQLite::Database& database) -> Status {
    CAIRN_RETURN_IF_ERROR(GoThroughRounds(plan_path, database, run));
    if (!run->is_planned) PlanPairs({}, database, run);  // all are known
    return Ok();
  }));
  const bool predicts = run->summary.pairs == "frustum" && run->options.num_frustum_seeds > 0;
  return WriteFileAtomically(
      plan_path + kNumShardsSuffix,
      fmt::format("{}{}\n", run->summary.num_shards_with_work,
                  IsLastPlan(run->summary, run->plan->num_shards, predicts) ? " last" : ""));
}

// `path`: of what the run writes.
Result<MatchFeaturesSummary> RunMatching(const MatchFeaturesInputs& inputs,
                                         const MatchFeaturesOptions& options, const std::string& path,
                                         uint64_t seed, int num_threads, Progress& progress,
                                         const ReuseOptions& reuse, const PlanOptions* plan) {
  CAIRN_RETURN_IF_ERROR(CheckRanges(options));
  const std::string& features_path = inputs.features_path;
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database features, OpenColmapDatabase(features_path));
  const auto images =
      WithDatabaseErrors(features_path, [&] { return ReadMatchImages(features, inputs.capture); });
  if (!images.ok()) return images.error();
  const MatchFeaturesOptions bounded = WithMemoryForFeatures(options, images->images.size());
  MatchRun run{.features = features,
               .images = *images,
               .inputs = inputs,
               .options = bounded,
               .reuse = reuse,
               .plan = plan,
               .seed = seed,
               .num_threads = num_threads,
               .progress = progress,
               .keys = PairKeys(features, *images, options.matching)};
  MatchFeaturesSummary& summary = run.summary;
  summary.num_images = static_cast<int>(images->images.size());
  summary.num_without_features = static_cast<int>(images->without_features.size());
  if (summary.num_images < 2 && !reuse.shard && plan == nullptr) {
    return MakeError(ErrorCode::kNoData, "{}: {} image(s) with features, at least 2 are needed to match",
                     features_path, summary.num_images);
  }
  ReuseOptions sources = reuse;
  if (reuse.shard && !inputs.plan_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(run.planned, ReadPlannedPairs(inputs.plan_path, *reuse.shard, *images));
    if (run.planned) {
      sources.files.clear();  // the plan knows what they have
    } else {
      sources.files.push_back(inputs.plan_path);  // it may have done a step before
    }
  }
  CAIRN_ASSIGN_OR_RETURN(summary.not_reused, AddReuseSources(sources, path, &run.named, &run.previous));
  cv::setNumThreads(1);  // pairs are the unit of parallel work
  summary.pairs = inputs.pair_list_path.empty() ? ChooseMethod(*images, options) : "list";
  CAIRN_RETURN_IF_ERROR(plan != nullptr ? WritePlan(path, &run)
                        : reuse.shard   ? WriteShard(path, &run)
                                        : WriteMatches(path, &run));
  CAIRN_RETURN_IF_ERROR(WriteReuseFile(path, std::move(run.entries)));
  return std::move(summary);
}

}  // namespace

Result<MatchFeaturesSummary> MatchFeatures(const MatchFeaturesInputs& inputs,
                                           const MatchFeaturesOptions& options,
                                           const std::string& matches_path, uint64_t seed, int num_threads,
                                           Progress& progress, const ReuseOptions& reuse) {
  return RunMatching(inputs, options, matches_path, seed, num_threads, progress, reuse, nullptr);
}

Result<MatchFeaturesSummary> PlanShards(const MatchFeaturesInputs& inputs,
                                        const MatchFeaturesOptions& options, const PlanOptions& plan,
                                        const std::string& plan_path, uint64_t seed, int num_threads,
                                        Progress& progress, const ReuseOptions& reuse) {
  return RunMatching(inputs, options, plan_path, seed, num_threads, progress, reuse, &plan);
}

}  // namespace cairn::match_features
