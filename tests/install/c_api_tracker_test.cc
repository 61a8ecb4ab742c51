#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/capture.h"
#include "runtime/c_api/cairn.h"
#include "runtime/drive/sure_tracker.h"
#include "runtime/localize/measurement.h"
#include "runtime/track/region_tracker.h"
#include "runtime/visual_map/visual_tracker.h"
#include "tests/install/c_image.h"
#include "tests/install/poster_drive.h"

namespace cairn {
namespace {

using testing::HasSubstr;

const PosterDrive& Drive() {
  static const PosterDrive drive;
  return drive;
}

const cv::Mat& Blank() {
  static const cv::Mat blank(240, 320, CV_8UC1, cv::Scalar(90));
  return blank;
}

void ExpectSamePose(const double (&rotation_wxyz)[4], const double (&translation_m)[3], const Pose& pose) {
  EXPECT_EQ(Eigen::Vector4d(rotation_wxyz),
            Eigen::Vector4d(pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z()));
  EXPECT_EQ(Eigen::Vector3d(translation_m), pose.translation);
}

void ExpectSame(const cairn_fix& fix, const Localization& expected) {
  ASSERT_EQ(fix.has_fix, expected.has_fix());
  EXPECT_EQ(fix.reason, static_cast<int32_t>(expected.reason));
  EXPECT_STREQ(cairn_scope_name(fix.scope), ScopeName(expected.scope));
  EXPECT_EQ(fix.region, expected.region);
  EXPECT_EQ(fix.num_inliers, expected.num_inliers);
  if (!expected.has_fix()) return;
  ExpectSamePose(fix.rotation_wxyz, fix.translation_m, expected.cam_from_world);
  EXPECT_EQ(Matrix6d(fix.covariance), expected.covariance.transpose());  // rows here, columns in Eigen
}

void ExpectSame(const cairn_floor_fix& fix, const VisualPose& expected, Scope scope) {
  ASSERT_EQ(fix.has_fix, expected.flag == VisualFlag::kNone);
  EXPECT_STREQ(cairn_scope_name(fix.scope), ScopeName(scope));
  EXPECT_EQ(fix.num_matches, expected.num_matches);
  EXPECT_EQ(fix.num_agreeing, expected.num_agreeing);
  EXPECT_EQ(Eigen::Matrix3d(fix.covariance), expected.covariance.transpose());
  EXPECT_EQ(Eigen::Vector2d(fix.mean_m), expected.mean);
  EXPECT_EQ(fix.entropy, expected.entropy);
  if (!fix.has_fix) return;
  EXPECT_EQ(Eigen::Vector2d(fix.position_m), expected.position);
  EXPECT_EQ(fix.heading_deg, expected.heading_deg);
}

// The drive's map.  It is closed before a test uses what was made of it, which goes on.
class CTrackers : public testing::Test {
 protected:
  CTrackers() {
    const std::string path = testing::TempDir() + "/c_api_drive.cairn";
    EXPECT_TRUE(WriteMapRows(Drive().rows(), path).ok());
    map_ = *Map::Open(path);
    cairn_map* map = nullptr;
    EXPECT_EQ(cairn_map_open(path.c_str(), nullptr, &map), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_tracker_create(map, &tracker_), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_visual_tracker_create(map, &visual_), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
  }
  ~CTrackers() override {
    EXPECT_EQ(cairn_tracker_destroy(tracker_), CAIRN_OK);
    EXPECT_EQ(cairn_visual_tracker_destroy(visual_), CAIRN_OK);
  }

  cairn_fix Track(int frame) {
    const cairn_image image = ImageOf(Drive().frames()[frame].picture);
    cairn_fix fix = CAIRN_FIX_INIT;
    EXPECT_EQ(cairn_tracker_track(tracker_, &image, nullptr, &fix), CAIRN_OK) << cairn_last_error();
    return fix;
  }
  cairn_floor_fix TrackOnFloor(int frame) {
    const cairn_image image = ImageOf(Drive().frames()[frame].picture);
    cairn_floor_fix fix = CAIRN_FLOOR_FIX_INIT;
    EXPECT_EQ(cairn_visual_tracker_track(visual_, &image, nullptr, &fix), CAIRN_OK) << cairn_last_error();
    return fix;
  }
  Camera QueryCamera() const { return *map_->CameraForSize(320, 240); }
  Query QueryOf(int frame) const {
    return *Localizer(map_).QueryFromImage(Drive().frames()[frame].picture, QueryCamera());
  }

  std::shared_ptr<const Map> map_;
  cairn_tracker* tracker_ = nullptr;
  cairn_visual_tracker* visual_ = nullptr;
};

TEST_F(CTrackers, InSpaceGiveTheFixesOfTheCxxTrackerBitForBit) {
  RegionTracker tracker(map_);
  cairn_prior prior = CAIRN_PRIOR_INIT;
  int32_t is_expected = -1;
  ASSERT_EQ(cairn_tracker_predict(tracker_, &is_expected, &prior), CAIRN_OK);
  EXPECT_EQ(is_expected, 0);
  for (int i = 0; i < static_cast<int>(Drive().frames().size()); ++i) {
    const DriveFrame& frame = Drive().frames()[i];
    const cairn_fix fix = Track(i);
    ExpectSame(fix, *tracker.Track(frame.picture, QueryCamera()));
    ASSERT_TRUE(fix.has_fix) << i << ": " << fix.message;
    EXPECT_LT((Eigen::Vector3d(fix.center_m) - frame.cam_from_world.Center()).norm(), 0.05) << i;
    EXPECT_EQ(fix.scope, i == 0 || i == PosterDrive::kCarried ? CAIRN_SCOPE_VOTES : CAIRN_SCOPE_TRACK) << i;
    ASSERT_EQ(cairn_tracker_predict(tracker_, &is_expected, &prior), CAIRN_OK);
    ASSERT_EQ(is_expected, 1);
    ExpectSamePose(prior.rotation_wxyz, prior.translation_m, tracker.Prediction()->cam_from_world);
    EXPECT_EQ(prior.sigma_m, tracker.Prediction()->sigma_m);
    EXPECT_EQ(prior.sigma_deg, tracker.Prediction()->sigma_deg);
  }
}

TEST_F(CTrackers, GoOnInTheDarkByOdometryAsTheCxxTrackerDoes) {
  RegionTracker tracker(map_);
  const cv::Mat dark = cv::Mat::zeros(QueryCamera().height, QueryCamera().width, CV_8UC1);
  int32_t is_known = -1;
  cairn_uncertain_pose believed = CAIRN_UNCERTAIN_POSE_INIT;
  ASSERT_EQ(cairn_tracker_believe(tracker_, &is_known, &believed), CAIRN_OK);
  EXPECT_EQ(is_known, 0);
  const auto track = [&](const cv::Mat& picture) {
    const cairn_image image = ImageOf(picture);
    cairn_fix fix = CAIRN_FIX_INIT;
    EXPECT_EQ(cairn_tracker_track(tracker_, &image, nullptr, &fix), CAIRN_OK) << cairn_last_error();
    ExpectSame(fix, *tracker.Track(picture, QueryCamera()));
    ASSERT_EQ(cairn_tracker_believe(tracker_, &is_known, &believed), CAIRN_OK);
    ASSERT_EQ(is_known, 1);
    ExpectSamePose(believed.rotation_wxyz, believed.translation_m, tracker.Believed()->pose);
    EXPECT_EQ(Eigen::Map<const Matrix6d>(believed.covariance), tracker.Believed()->covariance);
  };
  track(Drive().frames()[0].picture);
  ASSERT_EQ(cairn_tracker_move(tracker_, 0.2, 0.05, 0.1), CAIRN_OK) << cairn_last_error();
  ASSERT_TRUE(tracker.Move({0.2, 0.05}, 0.1).ok());
  track(dark);
  cairn_uncertain_pose motion = CAIRN_UNCERTAIN_POSE_INIT;
  motion.translation_m[2] = -0.3;  // ahead
  for (int i = 0; i < 6; ++i) motion.covariance[7 * i] = 1e-4;
  ASSERT_EQ(cairn_tracker_move_camera(tracker_, &motion), CAIRN_OK) << cairn_last_error();
  ASSERT_TRUE(
      tracker.Move({{Eigen::Quaterniond::Identity(), {0, 0, -0.3}}, 1e-4 * Matrix6d::Identity()}).ok());
  track(dark);
  motion.covariance[0] = -1;
  EXPECT_EQ(cairn_tracker_move_camera(tracker_, &motion), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), testing::HasSubstr("negative variance"));
  EXPECT_EQ(cairn_tracker_move_camera(tracker_, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_tracker_move(tracker_, std::nan(""), 0, 0), CAIRN_INVALID_ARGUMENT);
  believed.size = 8;
  EXPECT_EQ(cairn_tracker_believe(tracker_, &is_known, &believed), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_tracker_believe(tracker_, nullptr, &believed), CAIRN_INVALID_ARGUMENT);
}

TEST_F(CTrackers, PublishWhatIsSureAsTheCxxTrackerDoes) {
  EXPECT_EQ(cairn_tracker_elapse(tracker_, 0.1), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), testing::HasSubstr("min_place_probability"));
  EXPECT_EQ(cairn_tracker_sense_up(tracker_, 0, 0, 0, 2), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_tracker_sense_up(tracker_, 0, -1, 0, 2), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_tracker_set_option(tracker_, "min_place_probability", "0.97"), CAIRN_OK)
      << cairn_last_error();
  ASSERT_EQ(cairn_tracker_set_option(tracker_, "place_elsewhere_ratio", "0.6"), CAIRN_OK)
      << cairn_last_error();
  SureTrackerOptions options{.min_place_probability = 0.97};
  options.belief.elsewhere_ratio = 0.6;
  auto tracker = *SureTracker::Make(map_, {}, {}, options);
  for (int i = 0; i < static_cast<int>(Drive().frames().size()); ++i) {
    const DriveFrame& frame = Drive().frames()[i];
    ASSERT_EQ(cairn_tracker_elapse(tracker_, 0.4), CAIRN_OK);
    ASSERT_TRUE(tracker.Elapse(0.4).ok());
    if (i > 0) {
      ASSERT_EQ(cairn_tracker_move(tracker_, frame.ahead_m, 0, 0), CAIRN_OK) << cairn_last_error();
      ASSERT_TRUE(tracker.Move({frame.ahead_m, 0}, 0).ok());
    }
    ASSERT_EQ(cairn_tracker_sense_up(tracker_, 0, -1, 0, 2), CAIRN_OK) << cairn_last_error();
    ASSERT_TRUE(tracker.SenseUp({0, -1, 0}, 2).ok());
    ExpectSame(Track(i), *tracker.Track(frame.picture, QueryCamera()));
  }
}

TEST_F(CTrackers, FollowWithGravityAsTheCxxTrackerDoes) {
  RegionTracker tracker(map_);
  for (int i = 0; i < static_cast<int>(Drive().frames().size()); ++i) {
    const DriveFrame& frame = Drive().frames()[i];
    // Where it contradicts, there is no fix.
    const double right = i == 1 ? 0.7 : 0.01;
    ASSERT_EQ(cairn_tracker_sense_up(tracker_, right, -1, 0.02, 1), CAIRN_OK) << cairn_last_error();
    ASSERT_TRUE(tracker.SenseUp({{right, -1, 0.02}, 1}).ok());
    const Localization expected = *tracker.Track(frame.picture, QueryCamera());
    EXPECT_TRUE(i != 1 || !expected.has_fix());
    ExpectSame(Track(i), expected);
  }
}

TEST_F(CTrackers, OnTheFloorGiveTheFixesOfTheCxxTrackerBitForBit) {
  auto tracker = *VisualTracker::Make(map_);
  for (int i = 0; i < static_cast<int>(Drive().frames().size()); ++i) {
    const DriveFrame& frame = Drive().frames()[i];
    if (i > 0) {
      ASSERT_EQ(cairn_visual_tracker_move(visual_, frame.ahead_m, 0, 0), CAIRN_OK);
      ASSERT_TRUE(tracker.Move({frame.ahead_m, 0}, 0).ok());
    }
    const cairn_floor_fix fix = TrackOnFloor(i);
    const TrackedVisualPose expected = *tracker.See(QueryOf(i));
    ExpectSame(fix, expected.pose, expected.scope);
    ASSERT_TRUE(fix.has_fix) << i << ": " << fix.message;
    const Eigen::Vector2d at = frame.cam_from_world.Center().head<2>();
    EXPECT_LT((Eigen::Vector2d(fix.position_m) - at).norm(), 0.1) << i;
    EXPECT_EQ(fix.scope, i == 0 ? CAIRN_SCOPE_VOTES : CAIRN_SCOPE_TRACK) << i;
  }
  // Where the image shows nothing, the odometry alone decides.
  ASSERT_EQ(cairn_visual_tracker_move(visual_, 0.2, -0.1, 0.5), CAIRN_OK);
  ASSERT_TRUE(tracker.Move({0.2, -0.1}, 0.5).ok());
  const cairn_image image = ImageOf(Blank());
  cairn_floor_fix fix = CAIRN_FLOOR_FIX_INIT;
  ASSERT_EQ(cairn_visual_tracker_track(visual_, &image, nullptr, &fix), CAIRN_OK) << cairn_last_error();
  const TrackedVisualPose expected = *tracker.See(*Localizer(map_).QueryFromImage(Blank(), QueryCamera()));
  EXPECT_EQ(fix.has_fix, 0);
  ExpectSame(fix, expected.pose, expected.scope);
}

// A blank image has no fix, and the belief stays near where the robot was: nearer if it says that it stood.
TEST_F(CTrackers, OnTheFloorWithoutAFixGiveTheBelief) {
  const cairn_image image = ImageOf(Blank());
  cairn_floor_fix stands = CAIRN_FLOOR_FIX_INIT, drives = CAIRN_FLOOR_FIX_INIT;
  const cairn_floor_fix before = TrackOnFloor(2);
  ASSERT_EQ(cairn_visual_tracker_move(visual_, 0, 0, 0), CAIRN_OK);
  ASSERT_EQ(cairn_visual_tracker_track(visual_, &image, nullptr, &stands), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(stands.has_fix, 0);
  EXPECT_THAT(stands.message, HasSubstr("landmarks"));
  EXPECT_LT((Eigen::Vector2d(stands.mean_m) - Eigen::Vector2d(before.mean_m)).norm(), 0.1);
  EXPECT_GT(stands.entropy, before.entropy);
  ASSERT_TRUE(TrackOnFloor(2).has_fix);
  ASSERT_EQ(cairn_visual_tracker_track(visual_, &image, nullptr, &drives), CAIRN_OK) << cairn_last_error();
  EXPECT_GT(drives.entropy, stands.entropy + 0.5);
  EXPECT_GT(drives.covariance[0], stands.covariance[0]);
}

TEST_F(CTrackers, OptionsAreThoseThatTheTrackerReadsAndBeginAnew) {
  Track(0);
  EXPECT_EQ(Track(1).scope, CAIRN_SCOPE_TRACK);
  EXPECT_EQ(cairn_tracker_set_option(tracker_, "step_sigma", "1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("'step_sigma_m'"));
  EXPECT_EQ(cairn_tracker_set_option(tracker_, "step_sigma_m", "-1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(Track(2).scope, CAIRN_SCOPE_TRACK);
  // Of the tracker, of the vote and of the localizer.
  ASSERT_EQ(cairn_tracker_set_option(tracker_, "step_sigma_m", "2"), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_tracker_set_option(tracker_, "max_prior_sigma_m", "9"), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_tracker_set_option(tracker_, "min_num_votes", "5"), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(Track(2).scope, CAIRN_SCOPE_VOTES);
  EXPECT_EQ(Track(PosterDrive::kCarried).scope, CAIRN_SCOPE_TRACK);  // 2 m are near enough now
  ASSERT_EQ(cairn_tracker_set_option(tracker_, "min_num_inliers", "100000"), CAIRN_OK);
  EXPECT_EQ(Track(2).has_fix, 0);

  // On the floor: of features, of the visual map, of the tracker and its vote, of the filter, of the
  // estimate.
  TrackOnFloor(0);
  EXPECT_EQ(cairn_visual_tracker_set_option(visual_, "min_num_inliers", "9"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_visual_tracker_set_option(visual_, "kidnapped_ratio", "2"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(TrackOnFloor(1).scope, CAIRN_SCOPE_TRACK);
  for (const char* name : {"max_num_features", "keypoint_sigma_px", "model_budget_mib", "tracked_ratio",
                           "min_num_votes", "kidnapped_ratio"}) {
    EXPECT_EQ(cairn_visual_tracker_set_option(visual_, name, "1"), CAIRN_OK) << cairn_last_error();
  }
  EXPECT_EQ(TrackOnFloor(1).has_fix, 0);  // one feature
  EXPECT_EQ(cairn_visual_tracker_set_option(visual_, "max_num_features", "4000"), CAIRN_OK);
  EXPECT_EQ(cairn_visual_tracker_set_option(visual_, "min_num_agreeing", "100000"), CAIRN_OK);
  EXPECT_EQ(TrackOnFloor(1).has_fix, 0);
}

TEST_F(CTrackers, AfterAnErrorTheyAreAsBefore) {
  RegionTracker tracker(map_);
  auto visual = *VisualTracker::Make(map_);
  for (int i = 0; i < 3; ++i) {
    cairn_image image = ImageOf(Drive().frames()[i].picture);
    image.height = 100;
    cairn_fix fix = CAIRN_FIX_INIT;
    fix.has_fix = 1;
    EXPECT_EQ(cairn_tracker_track(tracker_, &image, nullptr, &fix), CAIRN_NOT_FOUND);
    EXPECT_EQ(fix.has_fix, 0);
    cairn_camera camera = CAIRN_CAMERA_INIT;  // of this size, which is not the survey's
    camera.width = 320;
    camera.height = 100;
    camera.num_params = 3;
    camera.params[0] = 280;
    cairn_floor_fix floor_fix = CAIRN_FLOOR_FIX_INIT;
    floor_fix.has_fix = 1;
    EXPECT_EQ(cairn_visual_tracker_track(visual_, &image, &camera, &floor_fix), CAIRN_UNSUPPORTED);
    EXPECT_EQ(floor_fix.has_fix, 0);
    EXPECT_EQ(cairn_visual_tracker_move(visual_, std::nan(""), 0, 0), CAIRN_INVALID_ARGUMENT);
    EXPECT_EQ(cairn_visual_tracker_move(visual_, 0, 0, HUGE_VAL), CAIRN_INVALID_ARGUMENT);
    ExpectSame(Track(i), *tracker.Track(Drive().frames()[i].picture, QueryCamera()));
    const TrackedVisualPose expected = *visual.See(QueryOf(i));
    ExpectSame(TrackOnFloor(i), expected.pose, expected.scope);
  }
}

TEST_F(CTrackers, UsedByTwoThreadsAtOnceAreBusy) {
  std::atomic<int> num_fixes = 0, num_busy = 0, num_other = 0;
  const auto count = [&](int32_t code, int32_t has_fix) {
    ++(code == CAIRN_OK && has_fix ? num_fixes : code == CAIRN_BUSY ? num_busy : num_other);
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      const cairn_image image = ImageOf(Drive().frames()[0].picture);
      for (int repeat = 0; repeat < 5; ++repeat) {
        cairn_fix fix = CAIRN_FIX_INIT;
        const int32_t code = cairn_tracker_track(tracker_, &image, nullptr, &fix);
        count(code, fix.has_fix);
        cairn_floor_fix floor_fix = CAIRN_FLOOR_FIX_INIT;
        const int32_t floor_code = cairn_visual_tracker_track(visual_, &image, nullptr, &floor_fix);
        count(floor_code, floor_fix.has_fix);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_GT(num_fixes, 0);
  EXPECT_GT(num_busy, 0);
  EXPECT_EQ(num_other, 0);
}

// A program built before there were trackers knows no scope and no belief.
TEST_F(CTrackers, ShorterFixesOfEarlierReleasesAreEnough) {
  const cairn_image image = ImageOf(Drive().frames()[0].picture);
  cairn_fix fix;
  std::memset(&fix, 0xff, sizeof(fix));
  fix.size = offsetof(cairn_fix, scope);
  ASSERT_EQ(cairn_tracker_track(tracker_, &image, nullptr, &fix), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(fix.has_fix, 1);
  EXPECT_EQ(fix.scope, -1);
  fix.size = offsetof(cairn_fix, scope) - 1;
  EXPECT_EQ(cairn_tracker_track(tracker_, &image, nullptr, &fix), CAIRN_INVALID_ARGUMENT);
  cairn_floor_fix floor_fix;
  std::memset(&floor_fix, 0xff, sizeof(floor_fix));
  floor_fix.size = offsetof(cairn_floor_fix, mean_m);
  ASSERT_EQ(cairn_visual_tracker_track(visual_, &image, nullptr, &floor_fix), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(floor_fix.has_fix, 1);
  EXPECT_TRUE(std::isnan(floor_fix.entropy));  // not written
  floor_fix.size = offsetof(cairn_floor_fix, mean_m) - 1;
  EXPECT_EQ(cairn_visual_tracker_track(visual_, &image, nullptr, &floor_fix), CAIRN_INVALID_ARGUMENT);
}

// A localizer and a tracker share a log: each place is kept once, whoever saw it.
TEST_F(CTrackers, ShareALogWithALocalizer) {
  const std::string folder = testing::TempDir() + "/c_api_log";
  std::filesystem::remove_all(folder);
  cairn_map* map = nullptr;
  ASSERT_EQ(cairn_map_open((testing::TempDir() + "/c_api_drive.cairn").c_str(), nullptr, &map), CAIRN_OK);
  cairn_log_options options = CAIRN_LOG_OPTIONS_INIT;
  cairn_log* log = nullptr;
  ASSERT_EQ(cairn_log_open(map, folder.c_str(), &options, &log), CAIRN_OK) << cairn_last_error();
  cairn_log* second = nullptr;
  EXPECT_EQ(cairn_log_open(map, folder.c_str(), nullptr, &second), CAIRN_BUSY);
  cairn_localizer* localizer = nullptr;
  cairn_tracker* tracker = nullptr;
  ASSERT_EQ(cairn_localizer_create(map, &localizer), CAIRN_OK);
  ASSERT_EQ(cairn_tracker_create(map, &tracker), CAIRN_OK);
  ASSERT_EQ(cairn_localizer_set_log(localizer, log), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_tracker_set_log(tracker, log), CAIRN_OK) << cairn_last_error();
  cairn_fix fix = CAIRN_FIX_INIT, plain = CAIRN_FIX_INIT;
  int64_t num_kept = -1;
  const auto see = [&](int frame, bool tracks) {
    const cairn_image image = ImageOf(Drive().frames()[frame].picture);
    EXPECT_EQ(tracks ? cairn_tracker_track(tracker, &image, nullptr, &fix)
                     : cairn_localize(localizer, &image, nullptr, nullptr, &fix),
              CAIRN_OK)
        << cairn_last_error();
    EXPECT_EQ(cairn_log_num_kept(log, &num_kept), CAIRN_OK);
    return num_kept;
  };
  EXPECT_EQ(see(0, false), 1);
  ASSERT_EQ(cairn_tracker_track(tracker_, nullptr, nullptr, &plain), CAIRN_INVALID_ARGUMENT);
  plain = Track(0);
  EXPECT_EQ(see(0, true), 1);
  EXPECT_EQ(Eigen::Vector3d(fix.translation_m), Eigen::Vector3d(plain.translation_m));
  EXPECT_EQ(see(PosterDrive::kCarried, true), 2);
  EXPECT_EQ(see(PosterDrive::kCarried, false), 2);
  const auto capture = ReadCapture(folder);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_EQ(capture->images.size(), 2u);
  EXPECT_EQ(capture->images[1].name, "00000002.pgm");
  EXPECT_LT(CenterErrorM(*capture->images[1].cam_from_world,
                         Drive().frames()[PosterDrive::kCarried].cam_from_world),
            0.05);
  // Without it, or when it is closed, answers go on.
  EXPECT_EQ(cairn_localizer_set_log(localizer, nullptr), CAIRN_OK);
  EXPECT_EQ(cairn_log_close(log), CAIRN_OK);
  EXPECT_EQ(cairn_log_close(log), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_log_num_kept(log, &num_kept), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_localizer_set_log(localizer, log), CAIRN_INVALID_ARGUMENT);
  const cairn_image image = ImageOf(Drive().frames()[0].picture);
  EXPECT_EQ(cairn_tracker_track(tracker, &image, nullptr, &fix), CAIRN_OK);
  EXPECT_EQ(fix.has_fix, 1);
  options.max_mb_per_day = -1;
  EXPECT_EQ(cairn_log_open(map, (folder + "_2").c_str(), &options, &log), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_log_open(map, nullptr, nullptr, &log), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_localizer_destroy(localizer), CAIRN_OK);
  EXPECT_EQ(cairn_tracker_destroy(tracker), CAIRN_OK);
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

}  // namespace
}  // namespace cairn
