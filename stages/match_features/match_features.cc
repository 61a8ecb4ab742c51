#include "stages/match_features/match_features.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "core/base/text.h"
#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "core/world/dropped_items.h"
#include "stages/match_features/match_round.h"
#include "stages/match_features/pairs/earlier_partners.h"
#include "stages/match_features/pairs/pair_list.h"
#include "stages/match_features/partners_by_looks.h"

namespace cairn::match_features {
namespace {

// How pairs are chosen: options.pairs, "auto" resolved.
std::string ChooseMethod(const MatchImages& images, const MatchFeaturesOptions& options) {
  if (options.pairs != "auto") return options.pairs;
  if (images.AllPosed()) return "frustum";
  const int num_images = static_cast<int>(images.images.size());
  return num_images <= options.max_num_exhaustive_images ? "exhaustive" : "retrieval";
}

Result<std::vector<PosedCamera>> PosedCameras(const MatchImages& images) {
  std::vector<PosedCamera> posed;
  for (const MatchImage& image : images.images) {
    if (!image.cam_from_world) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "pairs = frustum needs a pose for every image, but {} has none; give --capture, or "
                       "choose pairs = retrieval or exhaustive",
                       image.name);
    }
    posed.push_back({images.cameras.at(image.camera_id), *image.cam_from_world});
  }
  return posed;
}

// Each image with its neighbours in the order of names, and with loop candidates.
Result<std::optional<IndexPairs>> SelectSequencePairs(SQLite::Database* shard_database, MatchRun* run) {
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
  CAIRN_ASSIGN_OR_RETURN(const auto partners, PartnersByLooks(rule, shard_database, run));
  if (!partners) return std::optional<IndexPairs>();
  const IndexPairs loops = PairsFromPartners(*partners);
  pairs.insert(pairs.end(), loops.begin(), loops.end());
  std::sort(pairs.begin(), pairs.end());
  return std::optional(std::move(pairs));
}

Result<std::optional<IndexPairs>> SelectRetrievedPairs(SQLite::Database* shard_database, MatchRun* run) {
  const int num_retrieved = run->options.num_retrieved;
  const LooksRule rule = {.key = ContentHasher().Text("retrieved").UInt(num_retrieved).Finish(),
                          .partners = [&](const ImageSimilarity& similarity, const std::vector<int>& idxs) {
                            return RetrievedPartners(similarity, idxs, num_retrieved, run->num_threads);
                          }};
  CAIRN_ASSIGN_OR_RETURN(const auto partners, PartnersByLooks(rule, shard_database, run));
  if (!partners) return std::optional<IndexPairs>();
  return std::optional(PairsFromPartners(*partners));
}

// Pairs by every method but frustum.  Nothing where the run is a shard that has computed its share of
// choosing them and written it to its database.
Result<std::optional<IndexPairs>> SelectPairs(SQLite::Database* shard_database, MatchRun* run) {
  const std::string& method = run->summary.pairs;
  if (method == "list") {
    CAIRN_ASSIGN_OR_RETURN(PairList list, ReadPairList(run->inputs.pair_list_path, run->images));
    return std::optional(std::move(list.pairs));
  }
  if (method == "exhaustive")
    return std::optional(ExhaustivePairs(static_cast<int>(run->images.images.size())));
  return method == "sequence" ? SelectSequencePairs(shard_database, run)
                              : SelectRetrievedPairs(shard_database, run);
}

// What the predictor reads of the images, in the world frame.
Status AddViews(const MatchRun& run, PairPredictor* predictor) {
  for (const MatchImage& image : run.images.images) {
    if (run.progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while reading features");
    const Camera& camera = run.images.cameras.at(image.camera_id);
    CAIRN_ASSIGN_OR_RETURN(const std::vector<Eigen::Vector3d> bearings,
                           ReadImageBearings(run.features, image, camera));
    PairPredictor::View view;
    view.center = image.cam_from_world->Center();
    view.focal_px = camera.MeanFocal();
    view.generation = GenerationOfSession(image.session);
    const Eigen::Quaterniond world_from_cam = image.cam_from_world->rotation.conjugate();
    for (const Eigen::Vector3d& bearing : bearings)
      view.rays.push_back((world_from_cam * bearing).cast<float>());
    predictor->AddView(view);
  }
  return Ok();
}

// What was predicted of earlier sessions may be known.
Result<PredictionReuse> ReusePredictions(const PredictPairsOptions& options, MatchRun* run) {
  std::vector<ContentHash> image_keys;
  std::vector<int> generations;
  for (const MatchImage& image : run->images.images) {
    CAIRN_ASSIGN_OR_RETURN(const ContentHash image_key,
                           run->keys.OfImage(static_cast<int>(image_keys.size())));
    ContentHasher hasher;
    hasher.Hash(image_key);
    for (const double value : image.cam_from_world->rotation.coeffs()) hasher.Double(value);
    for (const double value : image.cam_from_world->translation) hasher.Double(value);
    image_keys.push_back(hasher.Finish());
    generations.push_back(GenerationOfSession(image.session));
  }
  return PredictionReuse(image_keys, std::move(generations), options);
}

// Pairs, ascending, that the matches so far predict, and that are not known.
Result<std::vector<PredictedPair>> PredictOrTakeOver(const IndexPairs& known,
                                                     const PredictPairsOptions& options,
                                                     PairPredictor* predictor, SQLite::Database& database,
                                                     MatchRun* run) {
  if (!run->predictions) return predictor->Predict(known, options, run->num_threads, run->progress);
  std::vector<PredictedPair> pairs;
  std::set<int> taken_over;
  const std::vector<int> generations = run->predictions->EndRound();
  for (const int generation : generations) {
    for (ReuseSources* const sources : {&run->named, &run->previous}) {
      const auto found = run->predictions->Find(generation, sources);
      if (!found) continue;
      pairs.insert(pairs.end(), found->begin(), found->end());
      taken_over.insert(generation);
      ++run->summary.num_predictions_taken_over;
      break;
    }
  }
  CAIRN_ASSIGN_OR_RETURN(const std::vector<PredictedPair> computed,
                         predictor->Predict(known, options, run->num_threads, run->progress, taken_over));
  pairs.insert(pairs.end(), computed.begin(), computed.end());
  std::sort(pairs.begin(), pairs.end(),
            [](const PredictedPair& a, const PredictedPair& b) { return a.idxs < b.idxs; });
  for (const int generation : generations)
    run->entries.push_back(run->predictions->Write(generation, pairs, database));
  return pairs;
}

EarlierPartners PartnersBySession(const MatchImages& images, double ratio) {
  std::vector<int> sessions;
  for (const MatchImage& image : images.images) sessions.push_back(image.session);
  return {std::move(sessions), ratio};
}

// All pairs whose frusta overlap.
Result<IndexPairs> OverlappingPairs(const std::vector<PosedCamera>& posed, const MatchRun& run) {
  std::vector<std::vector<int>> partners(posed.size());
  CAIRN_RETURN_IF_ERROR(RankOverlaps(posed, run.options.frustum, run.num_threads, run.progress,
                                     [&](int idx, const std::vector<OverlapPartner>& ranked) {
                                       for (const OverlapPartner& partner : ranked) {
                                         if (partner.idx > idx) partners[idx].push_back(partner.idx);
                                       }
                                     }));
  return PairsFromPartners(partners);
}

// The pairs of largest overlap.
Result<IndexPairs> SeedPairs(const std::vector<PosedCamera>& posed, const MatchRun& run,
                             EarlierPartners* partners) {
  const MatchFeaturesOptions& options = run.options;
  std::vector<EarlierPartners::Seeds> seeds(posed.size());
  CAIRN_RETURN_IF_ERROR(RankOverlaps(posed, options.frustum, run.num_threads, run.progress,
                                     [&](int idx, const std::vector<OverlapPartner>& ranked) {
                                       seeds[idx] = partners->SeedsOf(idx, ranked, options.num_frustum_seeds,
                                                                      options.num_frustum_scouts);
                                     }));
  return partners->TakeSeeds(seeds);
}

// Matches the pairs of largest overlap, then repeatedly those that the matches so far predict.
Status MatchFrustum(const std::string& matches_path, SQLite::Database& database, MatchRun* run) {
  const MatchFeaturesOptions& options = run->options;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<PosedCamera> posed, PosedCameras(run->images));
  if (options.num_frustum_seeds == 0) {
    CAIRN_ASSIGN_OR_RETURN(IndexPairs pairs, OverlappingPairs(posed, *run));
    CAIRN_RETURN_IF_ERROR(MatchRound(std::move(pairs), nullptr, database, run));
    return Ok();
  }
  EarlierPartners partners = PartnersBySession(run->images, options.earlier_partners_ratio);
  CAIRN_ASSIGN_OR_RETURN(IndexPairs next, SeedPairs(posed, *run, &partners));
  PairPredictor predictor(matches_path, int64_t{options.matching.memory_budget_mib} << 20);
  CAIRN_RETURN_IF_ERROR(AddViews(*run, &predictor));
  const PredictPairsOptions prediction = {
      .min_num_expected_matches = options.min_num_expected_matches,
      .max_ray_angle_deg = options.matching.verification.max_ray_angle_deg,
      .max_prior_error_px = options.matching.verification.max_prior_error_px,
      .min_baseline_m = options.matching.verification.min_baseline_m};
  if (!run->reuse.shard) {
    CAIRN_ASSIGN_OR_RETURN(run->predictions, ReusePredictions(prediction, run));
    CreatePredictionTable(database);
  }
  IndexPairs known = next;
  while (!next.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const bool goes_on, MatchRound(next, &predictor, database, run));
    if (!goes_on) break;
    CAIRN_ASSIGN_OR_RETURN(const std::vector<PredictedPair> predicted,
                           PredictOrTakeOver(known, prediction, &predictor, database, run));
    for (const PredictedPair& pair : predicted) known.push_back(pair.idxs);
    std::sort(known.begin(), known.end());
    next = partners.Choose(predicted);
  }
  return Ok();
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
      SQLite::Database database(temporary, SQLite::OPEN_READWRITE);
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

// Only the shard's results, without features.
Status WriteShard(const std::string& matches_path, MatchRun* run) {
  return WriteDatabase(matches_path, kColmapSchema, [&](SQLite::Database& database) -> Status {
    if (run->images.images.size() < 2) return Ok();
    if (run->summary.pairs == "frustum") return MatchFrustum(matches_path, database, run);
    CAIRN_ASSIGN_OR_RETURN(std::optional<IndexPairs> pairs, SelectPairs(&database, run));
    if (!pairs) return Ok();
    CAIRN_RETURN_IF_ERROR(MatchRound(std::move(*pairs), nullptr, database, run));
    return Ok();
  });
}

}  // namespace

Result<MatchFeaturesSummary> MatchFeatures(const MatchFeaturesInputs& inputs,
                                           const MatchFeaturesOptions& options,
                                           const std::string& matches_path, uint64_t seed, int num_threads,
                                           Progress& progress, const ReuseOptions& reuse) {
  CAIRN_RETURN_IF_ERROR(CheckRanges(options));
  const std::string& path = inputs.features_path;
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database features, OpenColmapDatabase(path));
  const auto images = WithDatabaseErrors(path, [&] { return ReadMatchImages(features, inputs.capture); });
  if (!images.ok()) return images.error();
  const MatchFeaturesOptions bounded = WithMemoryForFeatures(options, images->images.size());
  MatchRun run{.features = features,
               .images = *images,
               .inputs = inputs,
               .options = bounded,
               .reuse = reuse,
               .seed = seed,
               .num_threads = num_threads,
               .progress = progress,
               .keys = PairKeys(features, *images, options.matching)};
  MatchFeaturesSummary& summary = run.summary;
  summary.num_images = static_cast<int>(images->images.size());
  summary.num_without_features = static_cast<int>(images->without_features.size());
  if (summary.num_images < 2 && !reuse.shard) {
    return MakeError(ErrorCode::kNoData, "{}: {} image(s) with features, at least 2 are needed to match",
                     path, summary.num_images);
  }
  CAIRN_ASSIGN_OR_RETURN(summary.not_reused, AddReuseSources(reuse, matches_path, &run.named, &run.previous));
  cv::setNumThreads(1);  // pairs are the unit of parallel work
  summary.pairs = inputs.pair_list_path.empty() ? ChooseMethod(*images, options) : "list";
  CAIRN_RETURN_IF_ERROR(reuse.shard ? WriteShard(matches_path, &run) : WriteMatches(matches_path, &run));
  CAIRN_RETURN_IF_ERROR(WriteReuseFile(matches_path, std::move(run.entries)));
  return std::move(summary);
}

}  // namespace cairn::match_features
