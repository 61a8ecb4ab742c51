#include "runtime/localize/localizer.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "core/base/no_throw.h"
#include "core/base/pooled.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/features/features.h"
#include "core/work/affordable_sift.h"
#include "core/work/work_budget.h"
#include "runtime/localize/accept.h"
#include "runtime/localize/estimate.h"
#include "runtime/localize/match.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/place_evidence.h"
#include "runtime/localize/refine.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

PooledVector<Correspondence> Select(std::span<const Correspondence> correspondences,
                                    std::span<const int> indices) {
  PooledVector<Correspondence> selected;
  selected.reserve(indices.size());
  for (const int i : indices) selected.push_back(correspondences[i]);
  return selected;
}

Localization Failure(NoFix reason, std::string message) {
  Localization localization;
  localization.reason = reason;
  localization.message = std::move(message);
  return localization;
}

// REQUIRES: it is spent
Localization OverBudget(const WorkBudget& work, Localization found) {
  Localization none = Failure(
      NoFix::kOverBudget,
      fmt::format("{:.3g} ms of work (budget_ms, times core_speed) are not enough: {}", work.total_ms(),
                  found.num_features == 0  ? "the image's features alone take more"
                  : found.num_matches == 0 ? "they were done before landmarks were matched"
                                           : "they were done before a fix was sure"));
  none.scope = found.scope;
  none.num_features = found.num_features;
  none.num_matches = found.num_matches;
  none.num_unguided_inliers = found.num_unguided_inliers;
  none.candidates = std::move(found.candidates);
  none.work_ms = work.spent_ms();
  return none;
}

// As many of these as may be, evenly.
PooledVector<LandmarkIdx> Thinned(PooledVector<LandmarkIdx> landmarks, int64_t max_num) {
  const int64_t num = std::ssize(landmarks);
  if (num <= max_num) return landmarks;
  for (int64_t i = 0; i < max_num; ++i) landmarks[i] = landmarks[i * num / max_num];
  landmarks.resize(max_num);
  return landmarks;
}

// Part of what is left for an answer that goes to its first poses at most; what follows makes it sure.
constexpr double kEstimatePart = 0.5;
// Least part of the landmarks that an attempt is at: with fewer it says nothing of where they are.
constexpr double kLeastMatchedPart = 0.5;

// Whether half of the matches of one are the other's: then they explain the same by poses that differ, and
// not by different places.  Ascending by image and keypoint.
bool ShareMost(std::span<const Correspondence> a, std::span<const Correspondence> b) {
  const auto keypoint = [](const Correspondence& match) { return std::pair(match.image, match.keypoint); };
  size_t num_shared = 0;
  for (size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    num_shared += keypoint(a[i]) == keypoint(b[j]) && a[i].landmark == b[j].landmark ? 1 : 0;
    keypoint(a[i]) < keypoint(b[j]) ? ++i : ++j;
  }
  return 2 * num_shared >= std::min(a.size(), b.size());
}

// Factor on the covariance of fixes in maps that do not say how keypoints err together: measured on the demo,
// where it brings the normalised error squared from 10.7 to its 6 degrees of freedom.
constexpr double kUnmeasuredScale = 1.8;

}  // namespace

// What a first pose leads to: its own inliers, or what guided matching finds among the landmarks covisible
// with them, if that is no less.
struct Localizer::FollowedUp {
  int num_unguided_inliers = 0;
  std::shared_ptr<const LandmarkSet> covisible;  // null: its own inliers
  GuidedMatches found;
};

const char* ScopeName(Scope scope) {
  switch (scope) {
    case Scope::kPrior:
      return "prior";
    case Scope::kRegions:
      return "regions";
    case Scope::kImages:
      return "images";
    case Scope::kAll:
      return "all";
    case Scope::kTrack:
      return "track";
    case Scope::kVotes:
      return "votes";
  }
  return "all";
}

Localizer::Localizer(std::shared_ptr<const Map> map, const LocalizerOptions& options)
    : map_(std::move(map)), options_(options) {
  if (options.refine.keypoint_correlation == 0) {
    const MapHead& head = map_->head();
    options_.refine.keypoint_correlation = head.keypoint_correlation;
    if (head.covariance_scale > 0) {
      options_.refine.covariance_scale *= head.covariance_scale;
    } else if (head.keypoint_correlation == 0) {  // a map of an earlier program does not say
      options_.refine.covariance_scale *= kUnmeasuredScale;
    }
  }
}

Result<Localization> Localizer::Localize(const cv::Mat& grey, const Camera& camera,
                                         const std::optional<PosePrior>& prior,
                                         const std::optional<SensedUp>& up) {
  return WithoutExceptions("localize", [&]() -> Result<Localization> {
    CAIRN_ASSIGN_OR_RETURN(Query query, QueryFromImage(grey, camera));
    if (up) CAIRN_RETURN_IF_ERROR(SetUp(*up, &query));
    return LocalizeQuery(query, prior);
  });
}

Result<Localization> Localizer::LocalizeFeatures(Features features, const Camera& camera,
                                                 const std::optional<PosePrior>& prior,
                                                 const std::optional<SensedUp>& up) {
  return WithoutExceptions("localize", [&]() -> Result<Localization> {
    CAIRN_ASSIGN_OR_RETURN(Query query, QueryFromFeatures(std::move(features), camera));
    if (up) CAIRN_RETURN_IF_ERROR(SetUp(*up, &query));
    return LocalizeQuery(query, prior);
  });
}

Status Localizer::CheckImage(const cv::Mat& grey, const Camera& camera) const {
  CAIRN_RETURN_IF_ERROR(CheckQueryCamera(camera));
  if (grey.cols == camera.width && grey.rows == camera.height) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "localize: an image of {} x {} px with a camera of {} x {} px", grey.cols, grey.rows,
                   camera.width, camera.height);
}

std::shared_ptr<WorkBudget> Localizer::MakeBudget() const {
  if (options_.budget_ms == 0) return MakePooled<WorkBudget>();
  const double ms = options_.budget_ms * options_.core_speed;
  constexpr double kNone = -1;
  return MakePooled<WorkBudget>(ms > 0 ? ms : kNone);
}

Result<Query> Localizer::QueryFromImage(const cv::Mat& grey, const Camera& camera, Budget work) const {
  return QueryWithin(grey, camera, false, std::move(work));
}

Result<Query> Localizer::CoarseQueryFromImage(const cv::Mat& grey, const Camera& camera, Budget work) const {
  return QueryWithin(grey, camera, true, std::move(work));
}

Result<Query> Localizer::QueryWithin(const cv::Mat& grey, const Camera& camera, bool coarse,
                                     Budget work) const {
  CAIRN_RETURN_IF_ERROR(CheckImage(grey, camera));
  if (const DescriptorKind& kind = map_->head().descriptor_kind; !kind.is_sift()) {
    return MakeError(
        ErrorCode::kUnsupported,
        "the map's landmarks have descriptors of the kind '{}', and SIFT's alone are found in images here; "
        "give features of that kind (LocalizeFeatures, `cairn localize --features`)",
        ToString(kind));
  }
  if (!work) work = MakeBudget();
  const int64_t of_feature_ps =
      WorkBudget::PicosecondsOf(Work::kRay) + WorkBudget::PicosecondsOf(Work::kWord);
  CAIRN_ASSIGN_OR_RETURN(std::optional<AffordedSift> found,
                         AffordableSift(grey, options_.sift, coarse, of_feature_ps, work.get()));
  const bool had_no_room = !found;
  if (had_no_room) found.emplace();
  CAIRN_ASSIGN_OR_RETURN(Query query, QueryFromFeatures(std::move(found->features), camera, work));
  query.min_scale_px = found->min_scale_px;
  query.had_no_room = had_no_room;
  return query;
}

Status Localizer::AddFineFeatures(const cv::Mat& grey, int max_num,
                                  const std::function<bool(const Keypoint&)>& is_wanted, Query* query) const {
  CAIRN_RETURN_IF_ERROR(CheckImage(grey, query->camera));
  const int num_known = static_cast<int>(query->features.keypoints.size());
  WorkBudget* const work = query->work.get();
  CAIRN_ASSIGN_OR_RETURN(
      const Features features,
      AffordableFineSift(grey, options_.sift, std::min(max_num, options_.sift.max_num_features - num_known),
                         is_wanted, WorkBudget::PicosecondsOf(Work::kRay), work));
  if (features.keypoints.empty() || !Spend(work, Work::kRay, features.keypoints.size())) return Ok();
  AddFeatures(features, options_.measurement, query);
  return Ok();
}

Result<Query> Localizer::QueryFromFeatures(Features features, const Camera& camera, Budget work) const {
  CAIRN_RETURN_IF_ERROR(CheckQueryCamera(camera));
  if (features.descriptors.rows() != static_cast<Eigen::Index>(features.keypoints.size())) {
    return MakeError(ErrorCode::kInvalidArgument, "localize: {} keypoints with {} descriptors",
                     features.keypoints.size(), features.descriptors.rows());
  }
  CAIRN_RETURN_IF_ERROR(CheckSameKind(features.kind, map_->head().descriptor_kind, "the image"));
  if (features.descriptors.cols() != features.kind.num_values && features.descriptors.rows() > 0) {
    return MakeError(ErrorCode::kInvalidArgument, "localize: descriptors of {} values, expected {}",
                     features.descriptors.cols(), features.kind.num_values);
  }
  if (!work) work = MakeBudget();
  if (!Spend(work.get(), Work::kRay, features.keypoints.size())) {
    features.keypoints.clear();
    features.descriptors.resize(0, features.kind.num_values);
  }
  Query query = MakeQuery(std::move(features), AsFound(map_->head(), camera), options_.measurement);
  query.work = std::move(work);
  return query;
}

Status Localizer::SetUp(const SensedUp& up, Query* query) const {
  CAIRN_RETURN_IF_ERROR(CheckSensedUp(up));
  const MapHead& head = map_->head();
  query->up = UpMeasurement{head.camera_from_given.rotation * up.direction.normalized(),
                            head.floor_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ(),
                            RadFromDeg(std::hypot(up.sigma_deg, options_.floor_up_sigma_deg)),
                            options_.accept.max_up_sigmas};
  return Ok();
}

Result<Localization> Localizer::LocalizeQuery(const Sighting& query,
                                              const std::optional<PosePrior>& prior) const {
  const int num_features = query.num_features();
  const bool had_no_room =
      std::ranges::all_of(query.images, [](const Query& image) { return image.had_no_room; });
  if (had_no_room && query.work != nullptr) query.work->GiveUp();
  if (IsSpent(query.work)) return OverBudget(*query.work, Localization{.num_features = num_features});
  if (num_features < options_.accept.min_num_features) {
    Localization none = Failure(
        NoFix::kTooFewFeatures,
        fmt::format("{} features, at least {} are needed", num_features, options_.accept.min_num_features));
    none.num_features = num_features;
    if (query.work != nullptr) none.work_ms = query.work->spent_ms();
    return none;
  }
  return LocalizeBetter(query, prior, Failure(NoFix::kNoCandidates, "no survey image looks like it"));
}

Result<Localization> Localizer::LocalizeVoted(const Query& query, std::span<const LandmarkIdx> voted) const {
  CAIRN_ASSIGN_OR_RETURN(Localization localization, Try(query, WithAllImages(Scope::kVotes, voted, query)));
  if (localization.has_fix() && localization.num_unguided_inliers >= options_.sure_num_unguided_inliers)
    return Answer(query, std::nullopt, std::move(localization));
  return LocalizeBetter(query, std::nullopt, std::move(localization));
}

Result<Localization> Localizer::LocalizeBetter(const Sighting& sighting,
                                               const std::optional<PosePrior>& prior,
                                               Localization best) const {
  std::vector<ImageId> candidate_ids;
  WorkBudget* const work = sighting.work;
  CAIRN_ASSIGN_OR_RETURN(const PooledVector<Attempt> attempts, MakeAttempts(sighting, prior, &candidate_ids));
  for (const Attempt& attempt : attempts) {
    if (IsSpent(work)) break;
    CAIRN_ASSIGN_OR_RETURN(Localization localization, Try(sighting, attempt));
    best = BetterOf(std::move(best), std::move(localization), options_.accept);
    if (best.has_fix() && best.num_unguided_inliers >= options_.sure_num_unguided_inliers) break;
  }
  // An attempt that was cut short might have led elsewhere.
  if (IsSpent(work)) {
    best.num_features = sighting.num_features();
    best = OverBudget(*work, std::move(best));
  } else {
    CAIRN_ASSIGN_OR_RETURN(best, Answer(sighting, prior, std::move(best)));
  }
  best.candidates = std::move(candidate_ids);
  return best;
}

Result<Localization> Localizer::LocalizeAmong(const Query& query, Scope scope,
                                              std::span<const LandmarkIdx> landmarks,
                                              const std::optional<PosePrior>& prior) const {
  CAIRN_ASSIGN_OR_RETURN(Localization localization, Try(query, WithAllImages(scope, landmarks, query)));
  return Answer(query, prior, std::move(localization));
}

Result<Localization> Localizer::Answer(const Sighting& sighting, const std::optional<PosePrior>& prior,
                                       Localization localization) const {
  if (options_.exclude_look_alikes && localization.has_places()) {
    CAIRN_ASSIGN_OR_RETURN(localization, ExcludeLookAlikes(sighting, prior, std::move(localization)));
  }
  localization.num_features = sighting.num_features();
  if (IsSpent(sighting.work)) return OverBudget(*sighting.work, std::move(localization));
  if (sighting.work != nullptr) localization.work_ms = sighting.work->spent_ms();
  const Pose given_from_camera = map_->head().camera_from_given.Inverse();
  for (Pose& pose : localization.possible_poses) pose = given_from_camera * pose;
  if (localization.has_fix()) PutInGivenFrame(&localization);
  return localization;
}

void Localizer::PutInGivenFrame(Localization* fix) const {
  const Pose given_from_camera = map_->head().camera_from_given.Inverse();
  fix->cam_from_world = given_from_camera * fix->cam_from_world;
  fix->covariance = TransformCovariance(given_from_camera, fix->covariance);
  // The camera's place C is scale_centre + (1 + e) (C - scale_centre), and its translation is -R C.
  const Pose& found = fix->cam_from_world;
  fix->scale_sigma_m = -(found.rotation * ScaleSigmaAt(map_->head().frame, found.Center()));
  fix->covariance.bottomRightCorner<3, 3>() += fix->scale_sigma_m * fix->scale_sigma_m.transpose();
}

Result<Localization> Localizer::Sharpen(const Query& query, const LandmarkSet& landmarks,
                                        Localization fix) const {
  WorkBudget* const work = query.work.get();
  fix.num_features = static_cast<int>(query.features.keypoints.size());
  const Pose first = map_->head().camera_from_given * fix.cam_from_world;
  const PooledVector<Correspondence> matches = MatchGuided(query, landmarks, first, options_.match);
  const auto refined = RefinePoseWithCovariance(MakeMeasurements(query, landmarks, matches), first,
                                                options_.refine, query.up, query.work.get());
  if (IsSpent(work) || !refined || static_cast<int>(refined->inliers.size()) < fix.num_inliers ||
      AreFarApart(refined->cam_from_world, first, options_.accept))
    return fix;
  const PooledVector<Correspondence> inliers = Select(matches, refined->inliers);
  CAIRN_ASSIGN_OR_RETURN(const double distance,
                         DistanceFromSurvey(*map_, refined->cam_from_world.Center(), work));
  const Verdict verdict =
      JudgePose(*refined, inliers, query, distance, options_.accept, LengthUnit(map_->head().frame));
  if (verdict.reason != NoFix::kNone) return fix;
  CAIRN_ASSIGN_OR_RETURN(const RegionIdx region, RegionWithMost(*map_, LandmarksOf(inliers), work));
  if (IsSpent(work)) return fix;
  fix.region = region;
  fix.cam_from_world = refined->cam_from_world;
  fix.covariance = refined->covariance;
  PutInGivenFrame(&fix);
  fix.num_inliers = static_cast<int>(inliers.size());
  return fix;
}

Result<Localization> Localizer::Try(const Sighting& sighting, const Attempt& attempt) const {
  const AcceptOptions& accept = options_.accept;
  Localization localization;
  localization.scope = attempt.scope;
  const auto fail = [&](NoFix reason, std::string message) {
    localization.reason = reason;
    localization.message = std::move(message);
    return localization;
  };

  WorkBudget* const work = sighting.work;
  std::shared_ptr<const LandmarkSet> landmarks;  // of all images
  bool is_thinned = false;
  if (!Spend(work, Work::kAttempt, 1)) return OverBudget(*work, std::move(localization));
  PooledVector<Correspondence> matches;
  for (int image = 0; image < sighting.num_images(); ++image) {
    const PooledVector<LandmarkIdx>& idx = attempt.landmarks[image];
    const bool is_known = image > 0 && idx == attempt.landmarks[image - 1];
    const bool all = static_cast<int64_t>(idx.size()) == map_->num_landmarks();
    const int64_t max_num = MaxNumMatched(sighting.images[image]);
    const double least_part = attempt.may_be_thinned ? kLeastMatchedPart : 1;
    if (static_cast<double>(max_num) < least_part * static_cast<double>(idx.size())) work->GiveUp();
    if (is_thinned || !is_known || std::ssize(idx) > max_num) {
      is_thinned = is_thinned || std::ssize(idx) > max_num;
      if (!Spend(work, Work::kLandmark, all && !is_thinned ? 0 : std::min<int64_t>(std::ssize(idx), max_num)))
        return OverBudget(*work, std::move(localization));
      CAIRN_ASSIGN_OR_RETURN(
          landmarks, all && !is_thinned ? map_->AllLandmarks() : map_->Gather(Thinned(idx, max_num), true));
    }
    for (Correspondence match : MatchLandmarks(sighting.images[image], *landmarks, options_.match)) {
      match.image = image;
      matches.push_back(match);
    }
  }
  const bool are_same = std::all_of(attempt.landmarks.begin(), attempt.landmarks.end(),
                                    [&](const auto& idx) { return idx == attempt.landmarks.front(); });
  if (!are_same || (is_thinned && sighting.num_images() > 1)) {
    if (!Spend(work, Work::kLandmark, matches.size())) return OverBudget(*work, std::move(localization));
    CAIRN_ASSIGN_OR_RETURN(landmarks, map_->Gather(LandmarksOf(matches), false));
  }
  localization.num_matches = static_cast<int>(matches.size());
  localization.num_features = sighting.num_features();
  if (IsSpent(work)) return OverBudget(*work, std::move(localization));
  if (localization.num_matches < accept.min_num_matches) {
    return fail(NoFix::kTooFewMatches,
                fmt::format("{} matches with {} landmarks, at least {} are needed", matches.size(),
                            attempt.num_landmarks(), accept.min_num_matches));
  }
  const PooledVector<PoseMeasurement> measurements = MakeMeasurements(sighting, *landmarks, matches);
  const std::optional<UpMeasurement>& up = sighting.up;
  const char* with_gravity = up ? " with the sensed up" : "";
  std::optional<PoseEstimate> estimate;
  bool was_cut = false;
  {
    // Look-alikes are held against each other: with as many samples as they ask for, or not at all.
    const WorkBudget::Share share(work, attempt.may_be_thinned ? kEstimatePart : 1);
    estimate = EstimatePose(measurements, options_.estimate, options_.refine, kRansacSeed, up, work);
    was_cut = IsSpent(work);
  }
  // With more samples there might be a pose, or one of more matches.
  const auto give_up = [&] {
    work->GiveUp();
    return OverBudget(*work, std::move(localization));
  };
  if (!estimate && was_cut) return give_up();
  if (!estimate)
    return fail(NoFix::kNoPose, fmt::format("{} matches agree on no pose{}", matches.size(), with_gravity));
  localization.num_inliers = localization.num_unguided_inliers = static_cast<int>(estimate->inliers.size());
  const double chance_of_inlier =
      ChanceOfInlier(measurements, estimate->cam_from_world, options_.estimate.max_error_px, sighting);
  if (IsSpent(work)) return OverBudget(*work, std::move(localization));
  const double log10_chance =
      Log10ChancePoses(localization.num_matches, localization.num_unguided_inliers, chance_of_inlier,
                       UsesTwoPoints(measurements, up, options_.estimate) ? 2 : 3);
  if (localization.num_unguided_inliers < accept.min_num_unguided_inliers ||
      log10_chance > accept.max_log10_chance) {
    if (was_cut) return give_up();
    return fail(NoFix::kTooFewInliers,
                fmt::format("{} of {} matches agree on a pose{}, as they would by chance on 10^{:.1f} poses; "
                            "at least {} matches and at most 10^{:g} poses are needed",
                            estimate->inliers.size(), matches.size(), with_gravity, log10_chance,
                            accept.min_num_unguided_inliers, accept.max_log10_chance));
  }
  PooledVector<PoseEstimate> firsts;
  if (localization.num_unguided_inliers < options_.sure_num_unguided_inliers) {
    for (PoseEstimate& first : EstimatePoses(measurements, options_.estimate.max_num_first_poses,
                                             options_.estimate, options_.refine, kRansacSeed, up, work)) {
      if (static_cast<int>(first.inliers.size()) >= accept.min_num_unguided_inliers)
        firsts.push_back(std::move(first));
    }
  }
  // Of smaller errors, they may have fewer inliers than the one that was accepted.
  if (firsts.empty()) firsts.push_back(*estimate);
  if (auto second = SecondPose(measurements, *estimate, up, work)) firsts.push_back(*std::move(second));
  if (IsSpent(work)) return OverBudget(*work, std::move(localization));
  return Refine(sighting, *landmarks, matches, firsts, std::move(localization));
}

Result<Localizer::FollowedUp> Localizer::FollowUp(const Sighting& sighting,
                                                  std::span<const Correspondence> matches,
                                                  const PoseEstimate& first, int64_t max_num_guided) const {
  FollowedUp own{static_cast<int>(first.inliers.size()),
                 nullptr,
                 {Select(matches, first.inliers), first.cam_from_world}};
  if (options_.match.guided_num_images == 0) return own;
  CAIRN_ASSIGN_OR_RETURN(
      PooledVector<LandmarkIdx> seen,
      LandmarksToLookFor(sighting, own.found.matches, first.cam_from_world, max_num_guided));
  if (!Spend(sighting.work, Work::kLandmark, seen.size())) return own;
  CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const LandmarkSet> covisible, map_->Gather(seen, false));
  GuidedMatches guided =
      MatchGuidedInRounds(sighting, *covisible, first, options_.match, options_.estimate, options_.refine);
  if (guided.matches.size() < own.found.matches.size()) return own;
  return FollowedUp{own.num_unguided_inliers, std::move(covisible), std::move(guided)};
}

Result<PlaceEvidence> Localizer::EvidenceOf(const Sighting& sighting, const LandmarkSet& matched,
                                            const FollowedUp& followed_up) const {
  return EvidenceOfPlace(*map_, sighting, followed_up.found.cam_from_world,
                         followed_up.covisible ? *followed_up.covisible : matched, followed_up.found.matches,
                         followed_up.num_unguided_inliers, options_.accept.spread_grid);
}

Result<Localization> Localizer::Refine(const Sighting& sighting, const LandmarkSet& matched,
                                       std::span<const Correspondence> matches,
                                       std::span<const PoseEstimate> firsts,
                                       Localization localization) const {
  WorkBudget* const work = sighting.work;
  const auto fail = [&](NoFix reason, std::string message) {
    localization.reason = reason;
    localization.message = std::move(message);
    if (reason != NoFix::kImprobable) localization.probability = 0;
    return localization;
  };
  const int64_t max_num_guided = MaxNumGuided(sighting, firsts.size());
  PooledVector<FollowedUp> followed_up;
  size_t most = 0;
  for (const PoseEstimate& first : firsts) {
    CAIRN_ASSIGN_OR_RETURN(FollowedUp next, FollowUp(sighting, matches, first, max_num_guided));
    if (IsSpent(work)) return OverBudget(*work, std::move(localization));
    followed_up.push_back(std::move(next));
    if (followed_up.back().found.matches.size() > followed_up[most].found.matches.size())
      most = followed_up.size() - 1;
  }
  const FollowedUp& best = followed_up[most];
  const auto num_found = static_cast<double>(best.found.matches.size());
  localization.num_unguided_inliers = best.num_unguided_inliers;
  double odds_elsewhere = 0;
  const double max_second_pose_ratio = options_.accept.max_second_pose_ratio;
  for (const FollowedUp& other : followed_up) {
    if (max_second_pose_ratio <= 0 || ShareMost(other.found.matches, best.found.matches) ||
        !AreFarApart(other.found.cam_from_world, best.found.cam_from_world, options_.accept))
      continue;
    // One that begins with little and does not lead to most is less than ambiguous: it shares the
    // probability.
    const bool is_weak = best.num_unguided_inliers >= options_.sure_num_unguided_inliers &&
                         other.num_unguided_inliers < max_second_pose_ratio * best.num_unguided_inliers;
    if (!is_weak && static_cast<double>(other.found.matches.size()) >= max_second_pose_ratio * num_found) {
      CAIRN_ASSIGN_OR_RETURN(const PlaceEvidence here, EvidenceOf(sighting, matched, best));
      CAIRN_ASSIGN_OR_RETURN(const PlaceEvidence there, EvidenceOf(sighting, matched, other));
      if (IsSpent(work)) return OverBudget(*work, std::move(localization));
      return Ambiguous(std::move(localization), {best.found.cam_from_world, other.found.cam_from_world},
                       {OddsOfPlace(here), OddsOfPlace(there)}, odds_elsewhere,
                       fmt::format("{} and {} matches agree on poses at different places",
                                   best.found.matches.size(), other.found.matches.size()));
    }
    CAIRN_ASSIGN_OR_RETURN(const PlaceEvidence evidence, EvidenceOf(sighting, matched, other));
    if (IsSpent(work)) return OverBudget(*work, std::move(localization));
    odds_elsewhere += OddsOfPlace(evidence);
  }
  const LandmarkSet& landmarks = best.covisible ? *best.covisible : matched;
  if (best.covisible) {
    const double num_by_chance =
        GuidedByChance(sighting, landmarks, best.found.cam_from_world, options_.match);
    if (IsSpent(work)) return OverBudget(*work, std::move(localization));
    Verdict verdict =
        JudgeGuided(static_cast<int>(best.found.matches.size()), num_by_chance, options_.accept);
    if (verdict.reason != NoFix::kNone) {
      localization.num_inliers = 0;
      return fail(verdict.reason, std::move(verdict.message));
    }
  }
  CAIRN_ASSIGN_OR_RETURN(const PlaceEvidence evidence, EvidenceOf(sighting, matched, best));
  if (IsSpent(work)) return OverBudget(*work, std::move(localization));
  localization.probability = ProbabilityAmong(OddsOfPlace(evidence), odds_elsewhere);
  if (localization.probability < options_.accept.min_probability) {
    return fail(
        NoFix::kImprobable,
        fmt::format("an image from there would show {:.0f} landmarks in {:.0f} parts of the image; {} are "
                    "recognized, "
                    "and {:.0f} parts show any: right with a probability of {:.2f}, {} is needed",
                    evidence.num_expected, evidence.num_cells_expected, evidence.num_matched,
                    evidence.num_cells_found, localization.probability, options_.accept.min_probability));
  }
  const auto refined =
      RefinePoseWithCovariance(MakeMeasurements(sighting, landmarks, best.found.matches),
                               best.found.cam_from_world, options_.refine, sighting.up, work);
  if (IsSpent(work)) return OverBudget(*work, std::move(localization));
  if (!refined) {
    return fail(NoFix::kUncertain,
                fmt::format("{} inliers do not determine the pose", best.found.matches.size()));
  }
  const PooledVector<Correspondence> inliers = Select(best.found.matches, refined->inliers);
  localization.num_inliers = static_cast<int>(inliers.size());
  const double min_kept_ratio = options_.accept.min_kept_ratio;
  if (localization.num_inliers < min_kept_ratio * localization.num_unguided_inliers) {
    return fail(
        NoFix::kTooFewInliers,
        fmt::format(
            "of {} matches that agree on a pose {} are left after refinement; at least {:.0f} % are needed",
            localization.num_unguided_inliers, localization.num_inliers, 100 * min_kept_ratio));
  }
  CAIRN_ASSIGN_OR_RETURN(const double distance,
                         DistanceFromSurvey(*map_, refined->cam_from_world.Center(), work));
  if (IsSpent(work)) return OverBudget(*work, std::move(localization));
  Verdict verdict =
      JudgePose(*refined, inliers, sighting, distance, options_.accept, LengthUnit(map_->head().frame));
  if (verdict.reason != NoFix::kNone) return fail(verdict.reason, std::move(verdict.message));
  localization.reason = NoFix::kNone;
  localization.cam_from_world = refined->cam_from_world;
  localization.covariance = refined->covariance;
  CAIRN_ASSIGN_OR_RETURN(localization.region, RegionWithMost(*map_, LandmarksOf(inliers), work));
  if (IsSpent(work)) return OverBudget(*work, std::move(localization));
  return localization;
}

std::optional<PoseEstimate> Localizer::SecondPose(std::span<const PoseMeasurement> measurements,
                                                  const PoseEstimate& first,
                                                  const std::optional<UpMeasurement>& up,
                                                  WorkBudget* work) const {
  const AcceptOptions& accept = options_.accept;
  if (accept.max_second_pose_ratio <= 0) return std::nullopt;
  // What it leads to tells more than what it begins with.
  const double needed =
      std::max(0.5 * accept.max_second_pose_ratio * static_cast<double>(first.inliers.size()),
               static_cast<double>(accept.min_num_unguided_inliers));
  if (static_cast<double>(measurements.size() - first.inliers.size()) < needed) return std::nullopt;
  EstimateOptions estimate_options = options_.estimate;
  estimate_options.max_num_ransac_iterations = accept.num_second_pose_iterations;
  estimate_options.min_num_ransac_iterations =
      std::min(estimate_options.min_num_ransac_iterations, estimate_options.max_num_ransac_iterations);
  auto second =
      EstimateOtherPose(measurements, first, estimate_options, options_.refine, kRansacSeed, up, work);
  if (!second || static_cast<double>(second->inliers.size()) < needed ||
      !AreFarApart(first.cam_from_world, second->cam_from_world, accept))
    return std::nullopt;
  return second;
}

void QueryFrame::set_up(const SensedUp& up) {
  up_ = up;
  if (!query_) return;
  Query with_up = *query_;
  if (localizer_.SetUp(up, &with_up).ok()) query_ = MakePooled<Query>(std::move(with_up));
}

Result<const Query*> QueryFrame::WithAllFeaturesForLog() {
  if (!work_->is_limited()) return WithAllFeatures();
  if (!for_log_) {
    const auto any_work = std::make_shared<WorkBudget>();
    CAIRN_ASSIGN_OR_RETURN(Query query, grey_ ? localizer_.QueryFromImage(*grey_, camera_, any_work)
                                              : localizer_.QueryFromFeatures(features_, camera_, any_work));
    for_log_ = MakePooled<Query>(std::move(query));
  }
  return for_log_.get();
}

Result<const Query*> QueryFrame::WithAllFeatures() {
  if (!query_) {
    CAIRN_ASSIGN_OR_RETURN(Query query, grey_ ? localizer_.QueryFromImage(*grey_, camera_, work_)
                                              : localizer_.QueryFromFeatures(features_, camera_, work_));
    if (up_) CAIRN_RETURN_IF_ERROR(localizer_.SetUp(*up_, &query));
    query_ = MakePooled<Query>(std::move(query));
  }
  return query_.get();
}

}  // namespace cairn
