#pragma once

#include <memory>
#include <optional>
#include <span>

#include "core/base/pooled.h"
#include "runtime/localize/localizer.h"
#include "runtime/track/camera_motion.h"
#include "runtime/track/region_votes.h"

namespace cairn {

// Which features of an image are looked for where its landmarks are expected (expected_features.h).
struct ExpectedFeaturesOptions {
  // Whether at all; otherwise all features of each image are.
  bool map_guided = true;
  // Coarse features (SiftScales) give a fix, and at most so many fine ones, the strongest near the landmarks
  // that it puts into the image, make it more exact.  0: none do.  REQUIRES: >= 0
  int max_num_fine_features = 300;
  // How near, px, besides three standard deviations of the landmark's place and of the fix, in all at most
  // four times so far.  REQUIRES: > 0
  double fine_radius_px = 3;
};

// How a stream of frames is followed, beyond the localizer's own options.
struct RegionTrackerOptions {
  // Standard deviation of the change of motion from one frame to the next, m and degrees; every frame without
  // a fix adds as much.  REQUIRES: > 0
  double step_sigma_m = 0.15;
  double step_sigma_deg = 8;
  // A prediction less certain than this is not used: the robot is lost.  REQUIRES: > 0
  double max_prior_sigma_m = 0.6;
  // By odometry, too, a prediction is no more certain than this: fixes err more than they say.  REQUIRES: > 0
  double min_prior_sigma_m = 0.05;
  double min_prior_sigma_deg = 2;
  WheelErrorOptions wheels;
  // Of the time from one frame to the next, the part that a camera with a rolling shutter takes to read an
  // image, top row first: while it is followed, each row is seen from where the camera was then.  0: all rows
  // at once.  REQUIRES: in [0, 1]
  double readout_ratio = 0;
  // A tracked fix lies within this many standard deviations of the prediction.  REQUIRES: > 0
  double max_num_sigmas = 4;
  // Most regions besides its own, those of the nearest survey images, whose landmarks are looked for.
  // REQUIRES: >= 0
  int max_num_neighbour_regions = 6;
  ExpectedFeaturesOptions features;
  // When it is lost.
  VoteOptions votes;
};
// Without those of the vote, which have a table of their own; with those of odometry and of features.
OptionTable DescribeOptions(RegionTrackerOptions* options);

// Finds where a camera is, frame after frame [Sala06 §III].  While it has a fix it looks only for the
// landmarks of its region and of the regions around that the motion so far (odometry, or a constant velocity,
// less certain with every frame) predicts to be in view, in an image by features of their scales alone
// (expected_features.h); a fix far from the prediction does not count.  When
// that fails, all visible landmarks vote for the regions that they belong to (region_votes.h), and those of
// the regions with the most votes are matched; where these give no sure fix, the frame is localized as if it
// were the first. The latter two do not use earlier frames: a kidnapped robot is found again.  A region of
// four landmarks can be voted for, but a fix needs seven inliers (AcceptOptions::min_num_inliers): of several
// such regions, or of none.  Maps of more landmarks than fall_back_max_num_landmarks have no vote.  One per
// camera; the map is shared.
class RegionTracker {
 public:
  explicit RegionTracker(std::shared_ptr<const Map> map, const LocalizerOptions& localizer_options = {},
                         const RegionTrackerOptions& options = {});

  // How the camera moved since the last frame; several add up.  Over the floor: metres ahead and to the left,
  // in the frame that the camera had on it, and a turn to the left, in a map in metres whose floor is known.
  // Errors: as CheckUncertainPose; InvalidArgument (not finite), Unsupported (a map whose unit is not the
  // metre).
  Status Move(const UncertainPose& next_from_last);
  Status Move(const Eigen::Vector2d& way_m, double turn_left_rad);
  // Which way is up at the next frame.  Errors: as CheckSensedUp.
  Status SenseUp(const SensedUp& up);

  // The next frame; scope kTrack: found by the prediction.  The same frames, the same results.
  // Errors: as Localizer::Localize; the state is then as before.  No exception leaves it.
  Result<Localization> Track(const cv::Mat& grey, const Camera& camera);
  Result<Localization> TrackFeatures(Features features, const Camera& camera);
  // The same of a frame of which others use the features, too; it has a budget of its own, of the options of
  // the localizer that it was made with.
  Result<Localization> TrackFrame(QueryFrame* frame);

  // Where the next frame is expected; none when lost.
  std::optional<PosePrior> Prediction() const;
  // Where the camera was at the last frame: its fix, or where it moved since the last one, however uncertain
  // that is; and after Move, where it is now.  None before the first fix.
  std::optional<UncertainPose> Believed() const;

 private:
  Result<Localization> TrackQuery(const QueryFrame& frame, const Query& query,
                                  const std::optional<PosePrior>& prior);
  // Among these landmarks, with each row where it was read.
  Result<Localization> LocalizeByRows(const QueryFrame& frame, const Query& query,
                                      std::span<const LandmarkIdx> expected, const PosePrior& prior) const;
  // Found by the prediction, without the features of all of the image; nothing if not.
  Result<std::optional<Localization>> TrackExpected(const QueryFrame& frame, const PosePrior& prior);
  // Landmarks of its own and the neighbouring regions that the prediction has in view, ascending.
  Result<PooledVector<LandmarkIdx>> ExpectedLandmarks(const PosePrior& prior, const Camera& camera,
                                                      WorkBudget* work) const;
  // The visible landmarks vote for their regions.
  Result<Vote> VoteBy(const Query& query) const;
  Result<Localization> FindLost(const Query& query) const;
  bool Agrees(const Localization& found, const PosePrior& prior) const;
  // With the step to the next frame, where nobody told it.
  std::optional<MotionSinceFix> MotionToNext() const;
  void Update(const Localization& found);
  // Of the next frame, if this is its pose (as it is given), by how the camera moved until then.
  ReadoutMotion ReadoutOf(const Pose& given_cam_from_world) const;
  ReadoutMotion UnknownReadout() const;

  std::shared_ptr<const Map> map_;
  Localizer localizer_;
  Localizer expecting_localizer_;  // where landmarks are expected
  RegionTrackerOptions options_;
  Pose last_, step_;         // of the last fix; from each frame's camera to the next one's
  bool knows_step_ = false;  // by the last two frames
  RegionIdx region_ = -1;
  // Since the last fix.  These are of the map's camera frame.
  std::optional<MotionSinceFix> motion_;
  bool was_told_ = false;  // how it moved since the last frame
  std::optional<SensedUp> up_;
  std::optional<Pose> at_last_frame_;  // as far as it was known
  int num_frames_since_ = 0;           // the last fix
};

}  // namespace cairn
