#include "stages/match_features/frustum_rounds.h"

#include <algorithm>
#include <set>
#include <span>
#include <utility>

#include "stages/match_features/image_step.h"
#include "stages/match_features/match_round.h"
#include "stages/match_features/pairs/earlier_partners.h"

namespace cairn::match_features {
namespace {

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
    image_keys.push_back(ContentHasher().Hash(image_key).Hash(HashPose(*image.cam_from_world)).Finish());
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

// Hash of all that the ranks of an image's overlaps depend on.
ContentHasher HashRanking(const std::vector<PosedCamera>& posed, const FrustumOverlapOptions& options) {
  ContentHasher hasher;
  hasher.Double(options.near_m).Double(options.far_m).Double(options.min_overlap_ratio);
  hasher.Double(options.max_view_angle_deg).Double(options.max_scale_ratio);
  for (const PosedCamera& image : posed)
    hasher.Hash(HashCamera(image.camera)).Hash(HashPose(image.cam_from_world));
  return hasher;
}

// A step in which `take` makes an image's numbers, which are `is_valid`, of its partners, the largest overlap
// first.
ImageStep RankingStep(
    const std::string& name, ContentHasher hasher, const std::vector<PosedCamera>& posed, MatchRun* run,
    const std::function<bool(std::span<const int> numbers, int num_images)>& is_valid,
    const std::function<std::vector<int>(int idx, const std::vector<OverlapPartner>& ranked)>& take) {
  return {
      .name = name,
      .key = [all = hasher.Text(name).Finish()](int idx) -> Result<ContentHash> {
        return ContentHasher().Hash(all).UInt(idx).Finish();
      },
      .is_valid =
          [&posed, is_valid](const std::vector<int>& numbers) {
            return is_valid(numbers, static_cast<int>(posed.size()));
          },
      .compute = [&posed, run, take](const std::vector<int>& idxs) -> Result<std::vector<std::vector<int>>> {
        std::vector<std::vector<int>> results(posed.size());
        CAIRN_RETURN_IF_ERROR(RankOverlaps(
            posed, idxs, run->options.frustum, run->num_threads, run->progress,
            [&](int idx, const std::vector<OverlapPartner>& ranked) { results[idx] = take(idx, ranked); }));
        std::vector<std::vector<int>> of_idxs;
        for (const int idx : idxs) of_idxs.push_back(std::move(results[idx]));
        return of_idxs;
      }};
}

// All pairs whose frusta overlap.
Result<std::optional<IndexPairs>> OverlappingPairs(const std::vector<PosedCamera>& posed,
                                                   SQLite::Database& database, MatchRun* run) {
  const ImageStep step = RankingStep("overlaps", HashRanking(posed, run->options.frustum), posed, run,
                                     AreBelow, [](int idx, const std::vector<OverlapPartner>& ranked) {
                                       std::vector<int> later;
                                       for (const OverlapPartner& partner : ranked) {
                                         if (partner.idx > idx) later.push_back(partner.idx);
                                       }
                                       return later;
                                     });
  CAIRN_ASSIGN_OR_RETURN(const auto partners, RunImageStep(step, &database, run));
  return partners ? std::optional(PairsFromPartners(*partners)) : std::nullopt;
}

// The number of those within an image's generation, they, and those of earlier sessions.
bool AreSeeds(std::span<const int> numbers, int num_images) {
  return !numbers.empty() && 0 <= numbers.front() && numbers.front() < std::ssize(numbers) &&
         AreBelow(numbers.subspan(1), num_images);
}

// The pairs of largest overlap.
Result<std::optional<IndexPairs>> SeedPairs(const std::vector<PosedCamera>& posed, SQLite::Database& database,
                                            EarlierPartners* partners, MatchRun* run) {
  const MatchFeaturesOptions& options = run->options;
  ContentHasher hasher = HashRanking(posed, options.frustum);
  hasher.UInt(options.num_frustum_seeds).UInt(options.num_frustum_scouts);
  for (const MatchImage& image : run->images.images) hasher.UInt(image.session);

  const ImageStep step =
      RankingStep("seeds", std::move(hasher), posed, run, AreSeeds,
                  [&](int idx, const std::vector<OverlapPartner>& ranked) {
                    const EarlierPartners::Seeds seeds =
                        partners->SeedsOf(idx, ranked, options.num_frustum_seeds, options.num_frustum_scouts);
                    std::vector<int> numbers = {static_cast<int>(seeds.within.size())};
                    numbers.insert(numbers.end(), seeds.within.begin(), seeds.within.end());
                    numbers.insert(numbers.end(), seeds.earlier.begin(), seeds.earlier.end());
                    return numbers;
                  });
  CAIRN_ASSIGN_OR_RETURN(const auto results, RunImageStep(step, &database, run));
  if (!results) return std::optional<IndexPairs>();
  std::vector<EarlierPartners::Seeds> seeds;
  for (const std::vector<int>& numbers : *results) {
    const auto within = numbers.begin() + 1, earlier = within + numbers.front();
    seeds.push_back({{within, earlier}, {earlier, numbers.end()}});
  }
  return std::optional(partners->TakeSeeds(seeds));
}

}  // namespace

Status MatchFrustum(const std::string& matches_path, SQLite::Database& database, MatchRun* run) {
  const MatchFeaturesOptions& options = run->options;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<PosedCamera> posed, PosedCameras(run->images));
  if (options.num_frustum_seeds == 0) {
    CAIRN_ASSIGN_OR_RETURN(std::optional<IndexPairs> pairs, OverlappingPairs(posed, database, run));
    if (pairs) CAIRN_RETURN_IF_ERROR(MatchRound(std::move(*pairs), nullptr, database, run));
    return Ok();
  }
  EarlierPartners partners = PartnersBySession(run->images, options.earlier_partners_ratio);
  CAIRN_ASSIGN_OR_RETURN(const std::optional<IndexPairs> seeds, SeedPairs(posed, database, &partners, run));
  if (!seeds) return Ok();
  if (run->plan != nullptr && run->named.empty()) {  // no need to read what matches would predict
    CAIRN_RETURN_IF_ERROR(MatchRound(*seeds, nullptr, database, run));
    return Ok();
  }
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
  IndexPairs next = *seeds, known = next;
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

}  // namespace cairn::match_features
