#include "runtime/track/region_tracker.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "core/base/no_throw.h"
#include "core/base/pooled.h"
#include "core/work/work_budget.h"
#include "runtime/localize/match.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/landmark_set.h"
#include "runtime/track/expected_features.h"

namespace cairn {
OptionTable DescribeOptions(RegionTrackerOptions* o) {
  OptionTable table = {
      {.name = "step_sigma_m",
       .value = &o->step_sigma_m,
       .help = "standard deviation of the change of motion from frame to frame, m",
       .min = 1e-6},
      {.name = "step_sigma_deg",
       .value = &o->step_sigma_deg,
       .help = "the same of rotation, degrees",
       .min = 1e-6},
      {.name = "max_prior_sigma_m",
       .value = &o->max_prior_sigma_m,
       .help = "predictions less certain than this are not used, m",
       .min = 1e-6},
      {.name = "min_prior_sigma_m",
       .value = &o->min_prior_sigma_m,
       .help = "least standard deviation of a prediction by odometry, m",
       .min = 1e-6},
      {.name = "min_prior_sigma_deg",
       .value = &o->min_prior_sigma_deg,
       .help = "the same of rotation, degrees",
       .min = 1e-6},
      {.name = "max_num_sigmas",
       .value = &o->max_num_sigmas,
       .help = "a tracked fix lies within this many standard deviations of the prediction",
       .min = 1e-6},
      {.name = "max_num_neighbour_regions",
       .value = &o->max_num_neighbour_regions,
       .help = "most regions besides its own whose landmarks are looked for",
       .min = 0},
      {.name = "readout_ratio",
       .value = &o->readout_ratio,
       .help = "rolling shutter: part of the time from frame to frame in which an image is read, top row "
               "first; 0: all rows at once",
       .min = 0,
       .max = 1},
      {.name = "map_guided",
       .value = &o->features.map_guided,
       .help = "look for features of the scales and in the places that the map expects, while the camera is "
               "followed; false: for all features of each image"},
      {.name = "max_num_fine_features",
       .value = &o->features.max_num_fine_features,
       .help = "most features of fine scales that make a fix by coarse ones more exact; 0: none",
       .min = 0},
      {.name = "fine_radius_px",
       .value = &o->features.fine_radius_px,
       .help = "how near to where a landmark is expected they are looked for, px",
       .min = 0.1},
  };
  AddCondition({"map_guided", {"true"}}, {"max_num_fine_features", "fine_radius_px"}, &table);
  for (Option& option : DescribeOptions(&o->wheels)) table.push_back(std::move(option));
  return table;
}

namespace {

// What saves time where all landmarks but few are the right ones: no more samples than the matches ask for
// with the wanted confidence, and no wider search where a fix would be taken at once.
LocalizerOptions ExpectingOptions(LocalizerOptions options) {
  constexpr int kMinNumIterations = 16;
  options.estimate.min_num_ransac_iterations =
      std::min(options.estimate.min_num_ransac_iterations, kMinNumIterations);
  options.match.guided_sure_num_inliers =
      std::min(options.match.guided_sure_num_inliers, options.sure_num_unguided_inliers);
  return options;
}

}  // namespace

RegionTracker::RegionTracker(std::shared_ptr<const Map> map, const LocalizerOptions& localizer_options,
                             const RegionTrackerOptions& options)
    : map_(map),
      localizer_(map, localizer_options),
      expecting_localizer_(std::move(map), ExpectingOptions(localizer_options)),
      options_(options) {}

Result<Localization> RegionTracker::Track(const cv::Mat& grey, const Camera& camera) {
  return WithoutExceptions("track", [&]() -> Result<Localization> {
    QueryFrame frame(localizer_, grey, camera);
    return TrackFrame(&frame);
  });
}

Result<Localization> RegionTracker::TrackFeatures(Features features, const Camera& camera) {
  return WithoutExceptions("track", [&]() -> Result<Localization> {
    QueryFrame frame(localizer_, std::move(features), camera);
    return TrackFrame(&frame);
  });
}

Result<Localization> RegionTracker::TrackFrame(QueryFrame* frame) {
  return WithoutExceptions("track", [&]() -> Result<Localization> {
    if (up_) frame->set_up(*std::exchange(up_, std::nullopt));
    const std::optional<PosePrior> prior = Prediction();
    if (prior && options_.readout_ratio > 0)
      frame->set_readout([this](const Pose& pose) { return ReadoutOf(pose); });
    std::optional<Localization> found;
    if (prior && frame->image() != nullptr && options_.features.map_guided) {
      CAIRN_ASSIGN_OR_RETURN(found, TrackExpected(*frame, *prior));
    }
    if (!found) {
      CAIRN_ASSIGN_OR_RETURN(const Query* query, frame->WithAllFeatures());
      CAIRN_ASSIGN_OR_RETURN(found, TrackQuery(*frame, *query, prior));
    }
    found->work_ms = frame->work()->spent_ms();
    return *std::move(found);
  });
}

Status RegionTracker::Move(const UncertainPose& next_from_last) {
  CAIRN_RETURN_IF_ERROR(CheckUncertainPose(next_from_last));
  was_told_ = true;
  if (motion_) motion_->Add(next_from_last);
  return Ok();
}

Status RegionTracker::Move(const Eigen::Vector2d& way_m, double turn_left_rad) {
  const MapHead& head = map_->head();
  CAIRN_RETURN_IF_ERROR(CheckFloorMotion({way_m, turn_left_rad}, head));
  was_told_ = true;
  if (motion_) motion_->Add(FloorMotion{way_m, turn_left_rad}, head.floor_from_world, options_.wheels);
  return Ok();
}

Status RegionTracker::SenseUp(const SensedUp& up) {
  CAIRN_RETURN_IF_ERROR(CheckSensedUp(up));
  up_ = up;
  return Ok();
}

std::optional<MotionSinceFix> RegionTracker::MotionToNext() const {
  std::optional<MotionSinceFix> motion = motion_;
  if (motion && !was_told_) motion->AddUnknown(step_, options_.step_sigma_m, options_.step_sigma_deg);
  return motion;
}

std::optional<PosePrior> RegionTracker::Prediction() const {
  const std::optional<MotionSinceFix> motion = MotionToNext();
  if (!motion) return std::nullopt;
  PosePrior prior;
  prior.cam_from_world = map_->head().camera_from_given.Inverse() * motion->cam_from_world();
  if (motion->is_told()) {
    const Matrix6d covariance = motion->Predict(options_.wheels).covariance;
    prior.sigma_m = std::max(options_.min_prior_sigma_m, LargestSigma(covariance.bottomRightCorner<3, 3>()));
    prior.sigma_deg =
        std::max(options_.min_prior_sigma_deg, DegFromRad(LargestSigma(covariance.topLeftCorner<3, 3>())));
  } else {  // how well the last fix was known is little beside
    prior.sigma_m = motion->unknown_sigma_m();
    prior.sigma_deg = motion->unknown_sigma_deg();
  }
  if (prior.sigma_m > options_.max_prior_sigma_m) return std::nullopt;
  return prior;
}

std::optional<UncertainPose> RegionTracker::Believed() const {
  if (!motion_) return std::nullopt;
  const Pose given_from_camera = map_->head().camera_from_given.Inverse();
  UncertainPose believed = motion_->Predict(options_.wheels);
  return UncertainPose{given_from_camera * believed.pose,
                       TransformCovariance(given_from_camera, believed.covariance)};
}

Result<std::optional<Localization>> RegionTracker::TrackExpected(const QueryFrame& frame,
                                                                 const PosePrior& prior) {
  const Camera& camera = frame.camera();
  CAIRN_RETURN_IF_ERROR(CheckQueryCamera(camera));
  CAIRN_ASSIGN_OR_RETURN(const auto expected,
                         ExpectedLandmarks(prior, AsFound(map_->head(), camera), frame.work().get()));
  CAIRN_ASSIGN_OR_RETURN(Localization found, LocalizeExpected(*map_, expecting_localizer_, frame, expected,
                                                              prior, options_.features));
  if (!found.has_fix() || !Agrees(found, prior)) return std::optional<Localization>();
  Update(found);
  return std::optional(std::move(found));
}

Result<Localization> RegionTracker::TrackQuery(const QueryFrame& frame, const Query& query,
                                               const std::optional<PosePrior>& prior) {
  const bool has_features =
      static_cast<int>(query.features.keypoints.size()) >= localizer_.options().accept.min_num_features;
  // [Sala06 §III] inside a region its features are tracked; here those of its neighbours too
  if (has_features && prior) {
    CAIRN_ASSIGN_OR_RETURN(const auto expected, ExpectedLandmarks(*prior, query.camera, query.work.get()));
    CAIRN_ASSIGN_OR_RETURN(Localization found, LocalizeByRows(frame, query, expected, *prior));
    if (found.has_fix() && Agrees(found, *prior)) {
      Update(found);
      return found;
    }
  }
  // [Sala06 §III] a region whose features are not all visible was left: the visible ones vote
  std::optional<Query> by_rows;  // each where nobody knows how the camera moved
  if (options_.readout_ratio > 0) {
    by_rows = query;
    by_rows->readout = UnknownReadout();
  }
  const Query& lost = by_rows ? *by_rows : query;
  CAIRN_ASSIGN_OR_RETURN(Localization found,
                         has_features ? FindLost(lost) : localizer_.LocalizeQuery(lost, std::nullopt));
  Update(found);
  return found;
}

Result<Localization> RegionTracker::LocalizeByRows(const QueryFrame& frame, const Query& query,
                                                   std::span<const LandmarkIdx> expected,
                                                   const PosePrior& prior) const {
  if (options_.readout_ratio == 0) return localizer_.LocalizeAmong(query, Scope::kTrack, expected, prior);
  Query by_rows = query;
  by_rows.readout = frame.ReadoutOf(prior.cam_from_world);
  Spend(query.work.get(), Work::kLandmark, expected.size());
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, map_->Gather(expected, false));
  CAIRN_ASSIGN_OR_RETURN(Localization found,
                         localizer_.LocalizeAmong(by_rows, Scope::kTrack, expected, prior));
  if (!found.has_fix()) return found;
  // Now it is known how it moved.
  by_rows.readout = frame.ReadoutOf(found.cam_from_world);
  return localizer_.Sharpen(by_rows, *landmarks, std::move(found));
}

Result<Localization> RegionTracker::FindLost(const Query& query) const {
  CAIRN_ASSIGN_OR_RETURN(Vote vote, VoteBy(query));
  CAIRN_ASSIGN_OR_RETURN(PooledVector<LandmarkIdx> voted,
                         LandmarksOfRegions(*map_, vote.regions, query.work.get()));
  Localization found;
  if (!voted.empty()) {
    CAIRN_ASSIGN_OR_RETURN(found, options_.votes.localize_when_lost
                                      ? localizer_.LocalizeVoted(query, voted)
                                      : localizer_.LocalizeAmong(query, Scope::kVotes, voted, std::nullopt));
  } else if (options_.votes.localize_when_lost) {
    CAIRN_ASSIGN_OR_RETURN(found, localizer_.LocalizeQuery(query, std::nullopt));
  } else {
    found.scope = Scope::kVotes;
    found.message = std::move(vote.message);
    found.num_features = static_cast<int>(query.features.keypoints.size());
  }
  found.voted_regions = std::move(vote.regions);
  return found;
}

Result<PooledVector<LandmarkIdx>> RegionTracker::ExpectedLandmarks(const PosePrior& prior,
                                                                   const Camera& camera,
                                                                   WorkBudget* work) const {
  const RetrieveOptions& retrieve = localizer_.options().retrieve;
  CAIRN_ASSIGN_OR_RETURN(const auto near, RetrieveByPrior(*map_, prior, retrieve, work));
  CAIRN_ASSIGN_OR_RETURN(PooledVector<RegionIdx> regions, RegionsOfCandidates(*map_, near, retrieve));
  std::erase(regions, region_);
  if (static_cast<int>(regions.size()) > options_.max_num_neighbour_regions)
    regions.resize(options_.max_num_neighbour_regions);
  if (region_ >= 0) regions.push_back(region_);
  CAIRN_ASSIGN_OR_RETURN(PooledVector<LandmarkIdx> landmarks, LandmarksOfRegions(*map_, regions, work));
  if (map_->head().landmark_choice != "regions") {  // most landmarks belong to no region
    CAIRN_ASSIGN_OR_RETURN(const auto of_images, LandmarksOfImages(*map_, ImagesOf(near), kAnyNum, work));
    landmarks.insert(landmarks.end(), of_images.begin(), of_images.end());
    SortUnique(&landmarks);
  }
  // In view: within the camera's half diagonal of the optical axis, plus the uncertainty.
  const Pose cam_from_world = map_->head().camera_from_given * prior.cam_from_world;
  const std::optional<Eigen::Vector3d> corner = BearingFromImage(camera, {0, 0});
  if (!corner) return landmarks;
  const double half_view = std::atan2(corner->head<2>().norm(), corner->z()) +
                           RadFromDeg(options_.max_num_sigmas * prior.sigma_deg);
  if (!Spend(work, Work::kLandmark, landmarks.size())) return PooledVector<LandmarkIdx>();
  CAIRN_ASSIGN_OR_RETURN(const auto set, map_->Gather(landmarks, false));
  PooledVector<LandmarkIdx> in_view;
  in_view.reserve(set->idx.size());
  for (size_t i = 0; i < set->idx.size(); ++i) {
    const Eigen::Vector3d point = cam_from_world * set->landmarks[i].position;
    const double distance = point.norm();
    const double shift = options_.max_num_sigmas * prior.sigma_m;
    const double slack = distance > shift ? std::asin(shift / distance) : std::numbers::pi;
    if (std::atan2(point.head<2>().norm(), point.z()) <= half_view + slack) in_view.push_back(set->idx[i]);
  }
  return in_view;
}

Result<Vote> RegionTracker::VoteBy(const Query& query) const {
  const int max_num_landmarks = localizer_.options().fall_back_max_num_landmarks;
  const int64_t of_landmark =
      std::ssize(query.features.keypoints) * WorkBudget::PicosecondsOf(Work::kDescriptorPair);
  constexpr double kVotesPart = 0.3;
  if (map_->num_landmarks() > NumAffordable(query.work.get(), of_landmark, kVotesPart))
    return Vote{.message = "for votes no work is left (budget_ms)"};
  if (map_->num_landmarks() > max_num_landmarks) {
    return Vote{.message = fmt::format("the map's {} landmarks are too many to vote, at most {} may "
                                       "(fall_back_max_num_landmarks)",
                                       map_->num_landmarks(), max_num_landmarks)};
  }
  CAIRN_ASSIGN_OR_RETURN(const auto all, map_->AllLandmarks());
  PooledVector<LandmarkIdx> visible;
  for (const Correspondence& match : MatchLandmarks(query, *all, localizer_.options().match)) {
    visible.push_back(match.landmark);
  }
  return VoteForRegions(*map_, visible, options_.votes, query.work.get());
}

bool RegionTracker::Agrees(const Localization& found, const PosePrior& prior) const {
  return CenterErrorM(found.cam_from_world, prior.cam_from_world) <=
             options_.max_num_sigmas * prior.sigma_m &&
         RotationErrorDeg(found.cam_from_world, prior.cam_from_world) <=
             options_.max_num_sigmas * prior.sigma_deg;
}

ReadoutMotion RegionTracker::ReadoutOf(const Pose& given_cam_from_world) const {
  if (!at_last_frame_) return UnknownReadout();
  const Pose cam_from_world = map_->head().camera_from_given * given_cam_from_world;
  const Vector6d step = PerturbationBetween(*at_last_frame_, cam_from_world);
  if (!knows_step_)
    return {options_.readout_ratio * step,
            (options_.readout_ratio * step).cwiseAbs().cwiseMax(UnknownReadout().sigmas)};
  // That is how fast it was half a frame ago, by as much faster than a frame before as it may be now.
  const Vector6d faster = 0.5 * (step - PerturbationBetween(Pose(), step_));
  return {options_.readout_ratio * (step + faster), options_.readout_ratio * faster.cwiseAbs()};
}

ReadoutMotion RegionTracker::UnknownReadout() const {
  // What a motion may change by from frame to frame is for the worst of frames.
  constexpr double kUsualPart = 0.25;
  ReadoutMotion readout;
  readout.sigmas.head<3>().setConstant(RadFromDeg(options_.step_sigma_deg));
  readout.sigmas.tail<3>().setConstant(options_.step_sigma_m);
  readout.sigmas *= kUsualPart * options_.readout_ratio;
  return readout;
}

void RegionTracker::Update(const Localization& found) {
  if (!found.has_fix()) {
    motion_ = MotionToNext();
    at_last_frame_ = motion_ ? std::optional(motion_->cam_from_world()) : std::nullopt;
    knows_step_ = false;
    was_told_ = false;
    ++num_frames_since_;
    return;
  }
  const Pose& camera_from_given = map_->head().camera_from_given;
  const Pose cam_from_world = camera_from_given * found.cam_from_world;
  const bool is_next = found.scope == Scope::kTrack && num_frames_since_ == 0;
  step_ = is_next ? cam_from_world * last_.Inverse() : Pose();
  knows_step_ = is_next;
  last_ = cam_from_world;
  at_last_frame_ = cam_from_world;
  motion_.emplace(cam_from_world, TransformCovariance(camera_from_given, found.covariance));
  was_told_ = false;
  region_ = found.region;
  num_frames_since_ = 0;
}

}  // namespace cairn
