#include "runtime/track/region_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/localize/refine.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/landmark_set.h"
#include "runtime/track/region_votes.h"
#include "tests/option_limits.h"
#include "tests/runtime/localize/room_drive.h"

namespace cairn {
namespace {

Result<Localization> Show(RegionTracker& tracker, const Pose& pose, int frame) {
  return tracker.TrackFeatures(RenderFeatures(Room(), pose, {}, 500 + frame), Room().camera);
}

TEST(RegionTracker, FollowsADriveByItsPrediction) {
  RegionTracker tracker(RoomMap());
  EXPECT_FALSE(tracker.Prediction());
  for (int i = 0; i < 60; ++i) {
    const auto found = Show(tracker, OnDrive(i), i);
    ASSERT_TRUE(found.ok()) << found.error().message;
    ASSERT_TRUE(found->has_fix()) << i << ": " << found->message;
    EXPECT_LT(CenterErrorM(found->cam_from_world, OnDrive(i)), 0.05) << i;
    EXPECT_EQ(found->scope == Scope::kTrack, i > 0) << i;
  }
}

// How far the walls are along a ray of the camera's, metres: landmarks lie up to 0.3 m before them.
double WallDistance(const Pose& cam_from_world, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d from = cam_from_world.Center(), along = cam_from_world.rotation.conjugate() * ray;
  const double to_x = (std::copysign(4.85, along.x()) - from.x()) / along.x();
  const double to_y = (std::copysign(3.85, along.y()) - from.y()) / along.y();
  return std::min(to_x, to_y);
}

TEST(RegionTracker, PredictsConstantVelocity) {
  RegionTracker tracker(RoomMap());
  ASSERT_TRUE(Show(tracker, OnDrive(0), 0)->has_fix());
  // One fix: it may stand still.
  EXPECT_LT(CenterErrorM(tracker.Prediction()->cam_from_world, OnDrive(0)), 0.05);
  ASSERT_TRUE(Show(tracker, OnDrive(1), 1)->has_fix());
  EXPECT_LT(CenterErrorM(tracker.Prediction()->cam_from_world, OnDrive(2)), 0.08);
  EXPECT_LT(RotationErrorDeg(tracker.Prediction()->cam_from_world, OnDrive(2)), 1);
  EXPECT_DOUBLE_EQ(tracker.Prediction()->sigma_m, RegionTrackerOptions().step_sigma_m);
}

// Frame i of the drive as a rolling shutter sees it, read in such a part of the time between frames.
Features ReadByRows(int i, double readout_ratio, const RenderOptions& options) {
  const Vector6d step = PerturbationBetween(OnDrive(i), OnDrive(i + 1));
  Features features = RenderFeatures(Room(), OnDrive(i), options, i);
  // Each keypoint moves by how the middle of the room's walls, 4 m ahead, does until its row is read.
  for (Keypoint& keypoint : features.keypoints) {
    const auto ray = BearingFromImage(Room().camera, {keypoint.x, keypoint.y});
    const Eigen::Vector3d world =
        OnDrive(i).Inverse() * Eigen::Vector3d(*ray * WallDistance(OnDrive(i), *ray));
    Eigen::Vector2d pixel(keypoint.x, keypoint.y);
    for (int round = 0; round < 5; ++round) {
      const double part = pixel.y() / Room().camera.height - 0.5;
      pixel = *ImageFromCamera(Room().camera, Perturb(OnDrive(i), readout_ratio * part * step) * world);
    }
    keypoint.x = static_cast<float>(pixel.x());
    keypoint.y = static_cast<float>(pixel.y());
  }
  return features;
}

TEST(RegionTracker, KnowsWhenEachRowWasRead) {
  const RenderOptions exact{.keypoint_sigma_px = 0.2, .keypoint_sigma_per_scale = 0.05};
  RegionTracker rolling(RoomMap(), {}, {.readout_ratio = 0.7}), global(RoomMap());
  double sum_rolling = 0, sum_global = 0;
  constexpr int kNumFrames = 40;
  for (int i = 0; i < kNumFrames; ++i) {
    const Features features = ReadByRows(i, 0.7, exact);
    const auto by_rows = *rolling.TrackFeatures(features, Room().camera);
    const auto at_once = *global.TrackFeatures(features, Room().camera);
    ASSERT_TRUE(by_rows.has_fix()) << i << ": " << by_rows.message;
    if (i < 2) continue;  // how fast it moves is not known yet
    EXPECT_EQ(by_rows.scope, Scope::kTrack) << i;
    sum_rolling += CenterErrorM(by_rows.cam_from_world, OnDrive(i));
    sum_global += at_once.has_fix() ? CenterErrorM(at_once.cam_from_world, OnDrive(i)) : 0;
    if (at_once.has_fix()) EXPECT_GE(by_rows.num_inliers, at_once.num_inliers - 10) << i;
  }
  EXPECT_LT(sum_rolling / kNumFrames, 0.01);
  EXPECT_LT(sum_rolling, 0.3 * sum_global);
}

TEST(RegionTracker, GoesOnAfterBlankFramesUntilItIsLost) {
  RegionTracker tracker(RoomMap());
  ASSERT_TRUE(Show(tracker, OnDrive(0), 0)->has_fix());
  ASSERT_TRUE(Show(tracker, OnDrive(1), 1)->has_fix());
  for (int frame = 2; frame < 4; ++frame) {
    const auto blank = tracker.TrackFeatures({}, Room().camera);
    ASSERT_TRUE(blank.ok());
    EXPECT_EQ(blank->reason, NoFix::kTooFewFeatures);
  }
  EXPECT_DOUBLE_EQ(tracker.Prediction()->sigma_m, 3 * RegionTrackerOptions().step_sigma_m);
  const auto again = Show(tracker, OnDrive(4), 4);
  ASSERT_TRUE(again->has_fix());
  EXPECT_EQ(again->scope, Scope::kTrack);
  for (int frame = 5; frame < 10; ++frame) ASSERT_TRUE(tracker.TrackFeatures({}, Room().camera).ok());
  EXPECT_FALSE(tracker.Prediction());
  const auto found = Show(tracker, OnDrive(10), 10);
  ASSERT_TRUE(found->has_fix());
  EXPECT_NE(found->scope, Scope::kTrack);
}

TEST(RegionTracker, FindsAKidnappedRobotAtOnce) {
  Random random(9);
  for (int trial = 0; trial < 10; ++trial) {
    RegionTracker tracker(RoomMap());
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(Show(tracker, OnDrive(i), i)->has_fix());
    // Far away, or turned round where it stands.
    Pose elsewhere = trial == 0 ? PoseAt(OnDrive(3).Center(), 3.0 * 3 + 90 + 180) : RandomPose(random);
    if (CenterErrorM(elsewhere, OnDrive(3)) < 1.5) elsewhere = PoseAt(OnDrive(3).Center(), 279);
    const auto found = Show(tracker, elsewhere, 100 + trial);
    ASSERT_TRUE(found->has_fix()) << trial;
    EXPECT_LT(CenterErrorM(found->cam_from_world, elsewhere), 0.05) << trial;
    EXPECT_NE(found->scope, Scope::kTrack) << trial;
    const auto next = Show(tracker, elsewhere, 200 + trial);
    ASSERT_TRUE(next->has_fix());
    EXPECT_EQ(next->scope, Scope::kTrack) << trial;
  }
}

TEST(RegionTracker, BadFramesAreErrorsAndChangeNothing) {
  RegionTracker tracker(RoomMap());
  ASSERT_TRUE(Show(tracker, OnDrive(0), 0)->has_fix());
  ASSERT_TRUE(Show(tracker, OnDrive(1), 1)->has_fix());
  Features torn;
  torn.keypoints.resize(50);
  EXPECT_EQ(tracker.TrackFeatures(torn, Room().camera).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(tracker.Track(cv::Mat(10, 10, CV_8UC1), Room().camera).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(Show(tracker, OnDrive(2), 2)->scope, Scope::kTrack);
}

TEST(RegionTracker, OptionsHaveTheirRanges) {
  ExpectLimits<RegionTrackerOptions>({{"step_sigma_m", "1e-6", "9e-7"},
                                      {"step_sigma_deg", "1e-6", "9e-7"},
                                      {"max_prior_sigma_m", "1e-6", "9e-7"},
                                      {"min_prior_sigma_m", "1e-6", "9e-7"},
                                      {"min_prior_sigma_deg", "1e-6", "9e-7"},
                                      {"max_num_sigmas", "1e-6", "9e-7"},
                                      {"max_num_neighbour_regions", "0", "-1"},
                                      {"readout_ratio", "0", "-0.001", "1", "1.001"},
                                      {"max_num_fine_features", "0", "-1"},
                                      {"fine_radius_px", "0.1", "0.09"},
                                      {"wheel_way_ratio", "0", "-0.001", "10", "10.001"},
                                      {"wheel_way_sigma_m", "1e-6", "9e-7"},
                                      {"wheel_turn_ratio", "0", "-0.001", "10", "10.001"},
                                      {"wheel_turn_sigma_deg", "1e-6", "9e-7"},
                                      {"wheel_drift_deg", "0", "-0.001", "90", "90.001"}});
}

TEST(RegionTracker, VotesGoToTheRegionThatHasMost) {
  const std::vector<MapRegion>& regions = Room().rows.regions;
  const std::vector<LandmarkIdx> seen(regions[2].landmarks.begin(), regions[2].landmarks.begin() + 40);
  const auto votes = *VotesForRegions(*RoomMap(), seen);
  ASSERT_FALSE(votes.empty());
  EXPECT_EQ(votes[0].num_votes, 40);
  for (const RegionVotes& vote : votes) {
    EXPECT_EQ(vote.num_votes, NumShared(regions[vote.region].landmarks, seen));
  }
  EXPECT_TRUE(VotesForRegions(*RoomMap(), {})->empty());
}

}  // namespace
}  // namespace cairn
