// A camera that is followed asks the system for no memory, frame by frame.
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/blocks/map_rows.h"
#include "core/features/sift.h"
#include "runtime/c_api/cairn.h"
#include "runtime/drive/sure_tracker.h"
#include "runtime/track/region_tracker.h"
#include "tests/install/c_image.h"
#include "tests/runtime/localize/poster_scene.h"
#include "tests/runtime/track/count_requests.h"

namespace cairn {
namespace {

constexpr int kNumFrames = 8;

// Back and forth before the poster: at which of its places a frame is.
int PlaceOf(int frame) {
  const int at = frame % kNumFrames;
  return frame % (2 * kNumFrames) < kNumFrames ? at : kNumFrames - 1 - at;
}

Pose PoseOfFrame(int i) {
  const int at = PlaceOf(i);
  return PoseAt({0.02 * at, 0.03 * at - 0.1, 1.5}, 0.5 * at);
}

const cv::Mat& ImageOfFrame(int i) {
  static const std::vector<cv::Mat> images = [] {
    std::vector<cv::Mat> rendered;
    for (int k = 0; k < kNumFrames; ++k) rendered.push_back(RenderPoster(Poster(), PoseOfFrame(k)));
    return rendered;
  }();
  return images[PlaceOf(i)];
}

// The requests of the third time to and fro: the first two ask for the most that any frame needs.
long RequestsOf(const std::function<bool(int)>& has_fix_at_frame) {
  constexpr int kRound = 2 * kNumFrames;
  for (int i = 0; i < 2 * kRound; ++i) EXPECT_TRUE(has_fix_at_frame(i)) << i;
  const long before = num_requests;
  int num_fixes = 0;
  for (int i = 0; i < kRound; ++i) num_fixes += has_fix_at_frame(i) ? 1 : 0;
  const long num = num_requests - before;
  EXPECT_EQ(num_fixes, kRound);
  return num;
}

class Steady : public testing::Test {
 protected:
  void SetUp() override {
    if (!KeepsPooled()) GTEST_SKIP() << "sanitizers get all memory back";
    cv::setNumThreads(1);
    ImageOfFrame(0);
  }
};

RegionTracker MakeTracker(LocalizerOptions localizer = PosterOptions(),
                          const RegionTrackerOptions& options = {}) {
  return RegionTracker(PosterMap(), localizer, options);
}

// Whether a frame was found where it was expected.
bool IsTracked(const Result<Localization>& found) {
  return found.ok() && found->has_fix() && found->scope == Scope::kTrack;
}
bool HasFix(const Result<Localization>& found) { return found.ok() && found->has_fix(); }

TEST_F(Steady, TheCountCounts) {
  const long before = num_requests;
  std::make_unique<std::vector<int>>(100)->push_back(1);
  EXPECT_GE(num_requests - before, 3);
}

TEST_F(Steady, ByImages) {
  RegionTracker tracker = MakeTracker();
  int num_tracked = 0;
  EXPECT_EQ(RequestsOf([&](int i) {
              const auto found = tracker.Track(ImageOfFrame(i), Poster().camera);
              num_tracked += IsTracked(found) ? 1 : 0;
              return HasFix(found);
            }),
            0);
  EXPECT_GE(num_tracked, 6 * kNumFrames - 1);
}

TEST_F(Steady, ByAllFeaturesOfImages) {
  RegionTracker tracker = MakeTracker(PosterOptions(), {.features = {.map_guided = false}});
  EXPECT_EQ(RequestsOf([&](int i) { return HasFix(tracker.Track(ImageOfFrame(i), Poster().camera)); }), 0);
}

TEST_F(Steady, ByGivenFeatures) {
  std::vector<Features> features;
  for (int i = 0; i < kNumFrames; ++i) features.push_back(*ExtractSift(ImageOfFrame(i), {}));
  RegionTracker tracker = MakeTracker();
  EXPECT_EQ(
      RequestsOf([&](int i) { return HasFix(tracker.TrackFeatures(features[PlaceOf(i)], Poster().camera)); }),
      0);
}

TEST_F(Steady, WithOdometryGravityAndARollingShutter) {
  RegionTracker tracker = MakeTracker(PosterOptions(), {.readout_ratio = 0.2});
  EXPECT_EQ(RequestsOf([&](int i) {
              if (i > 0) {
                const Pose moved = PoseOfFrame(i) * PoseOfFrame(i - 1).Inverse();
                EXPECT_TRUE(tracker.Move({moved, 1e-4 * Matrix6d::Identity()}).ok());
              }
              EXPECT_TRUE(tracker.SenseUp({-Eigen::Vector3d::UnitY(), 1}).ok());
              return HasFix(tracker.Track(ImageOfFrame(i), Poster().camera));
            }),
            0);
}

TEST_F(Steady, WithinABudget) {
  LocalizerOptions options = PosterOptions();
  options.budget_ms = 50;
  RegionTracker tracker = MakeTracker(options);
  EXPECT_EQ(RequestsOf([&](int i) { return HasFix(tracker.Track(ImageOfFrame(i), Poster().camera)); }), 0);
}

TEST_F(Steady, BySureTracker) {
  SureTracker tracker = *SureTracker::Make(PosterMap(), PosterOptions(), {}, {});
  EXPECT_EQ(RequestsOf([&](int i) { return HasFix(tracker.Track(ImageOfFrame(i), Poster().camera)); }), 0);
}

TEST_F(Steady, ThroughTheCApi) {
  const std::string path = testing::TempDir() + "/steady.cairn";
  ASSERT_TRUE(WriteMapRows(MakePosterMap(Poster()), path).ok());
  cairn_map* map = nullptr;
  cairn_tracker* tracker = nullptr;
  ASSERT_EQ(cairn_map_open(path.c_str(), nullptr, &map), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_tracker_create(map, &tracker), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_tracker_set_option(tracker, "max_ratio", "0.95"), CAIRN_OK) << cairn_last_error();
  cairn_camera camera = CAIRN_CAMERA_INIT;
  ASSERT_EQ(cairn_map_camera_for_size(map, 320, 240, &camera), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(RequestsOf([&](int i) {
              const cairn_image image = ImageOf(ImageOfFrame(i));
              cairn_fix fix = CAIRN_FIX_INIT;
              EXPECT_EQ(cairn_tracker_track(tracker, &image, &camera, &fix), CAIRN_OK) << cairn_last_error();
              return fix.has_fix != 0;
            }),
            0);
  EXPECT_EQ(cairn_tracker_destroy(tracker), CAIRN_OK);
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

// What no thread keeps for another comes from the system, once.
TEST_F(Steady, EachThreadForItself) {
  long num = 0;
  std::thread([&] {
    RegionTracker tracker = MakeTracker();
    num = RequestsOf([&](int i) { return HasFix(tracker.Track(ImageOfFrame(i), Poster().camera)); });
  }).join();
  EXPECT_EQ(num, 0);
}

}  // namespace
}  // namespace cairn
