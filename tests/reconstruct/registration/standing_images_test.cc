#include "stages/reconstruct/registration/standing_images.h"
#include "core/base/pooled.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::reconstruct {
namespace {

// Images of 640 x 480 px with twenty keypoints, each image moved against the first by so many pixels to the
// right; all are matched with all.  Allowed are 3.2 px.
MapperInput MovedImages(const std::vector<float>& shifts_px) {
  MapperInput input;
  input.cameras.emplace(1, GuessCamera(1, 640, 480));
  for (size_t i = 0; i < shifts_px.size(); ++i) {
    input.images.push_back({static_cast<ImageId>(10 + i), "", 1});
    PooledVector<Keypoint> keypoints;
    for (int k = 0; k < 20; ++k)
      keypoints.push_back({.x = static_cast<float>(20 * k) + shifts_px[i], .y = 50, .scale = 1});
    input.keypoints.push_back(keypoints);
    for (size_t j = 0; j < i; ++j) {
      TwoViewGeometry pair{.image_id1 = static_cast<ImageId>(10 + j),
                           .image_id2 = static_cast<ImageId>(10 + i)};
      for (KeypointIdx k = 0; k < 20; ++k) pair.inliers.push_back({k, k});
      input.geometries.push_back(pair);
    }
  }
  return input;
}

// Which image each repeats, -1: none.
std::vector<int> Repeats(const MapperInput& input, const std::vector<int>& images) {
  std::vector<int> repeats;
  for (const auto& repeated : FindStandingImages(input, images))
    repeats.push_back(repeated ? repeated->image : -1);
  return repeats;
}

// 0 and 1 are within reach, and 1 and 2, but not 0 and 2; 4 is back at 0.
TEST(StandingImages, RepeatAnImageThatRepeatsNone) {
  const MapperInput input = MovedImages({0, 2, 4, 50, 1});
  EXPECT_THAT(Repeats(input, {0, 1, 2, 3, 4}), testing::ElementsAre(-1, 0, -1, -1, 0));
  EXPECT_EQ(FindStandingImages(input, {0, 1})[1]->shift_px, 2);
  // The nearest: 2.5 from 0, 1.5 from 2.
  EXPECT_THAT(Repeats(MovedImages({0, 9, 4, 2.5}), {0, 1, 2, 3}), testing::ElementsAre(-1, -1, -1, 2));
}

TEST(StandingImages, ImagesOfOtherSessionsAndCamerasAreNotRepeated) {
  MapperInput input = MovedImages({0, 0, 0});
  EXPECT_THAT(Repeats(input, {1, 2}), testing::ElementsAre(-1, -1, 1));
  input.cameras.emplace(2, GuessCamera(2, 640, 480));
  input.images[2].camera_id = 2;
  EXPECT_THAT(Repeats(input, {1, 2}), testing::ElementsAre(-1, -1, -1));
}

// What passes before the camera: two of twenty keypoints may have moved, or sixteen may be gone.
TEST(StandingImages, SomeThingsMayMove) {
  MapperInput input = MovedImages({0, 0});
  for (int k = 0; k < 2; ++k) input.keypoints[1][k].x += 100;
  EXPECT_THAT(Repeats(input, {0, 1}), testing::ElementsAre(-1, 0));
  input.keypoints[1][2].x += 100;
  EXPECT_THAT(Repeats(input, {0, 1}), testing::ElementsAre(-1, -1));
  input = MovedImages({0, 0});
  input.geometries[0].inliers.resize(4);
  EXPECT_THAT(Repeats(input, {0, 1}), testing::ElementsAre(-1, 0));
  input.geometries[0].inliers.resize(3);
  EXPECT_THAT(Repeats(input, {0, 1}), testing::ElementsAre(-1, -1));
}

// 0 -> 1 -> 2 -> 3, where 2 repeats 1.
TEST(StandingImages, MotionsGoOnWhereTheCameraStood) {
  const Pose ahead{Eigen::Quaterniond::Identity(), {0, 0, -1}};
  const std::vector<ImageMotion> motions = {{0, 1, ahead}, {1, 2, Pose()}, {2, 3, ahead}};
  const auto between =
      MotionsOfRepeated(motions, {std::nullopt, std::nullopt, RepeatedImage{1}, std::nullopt});
  ASSERT_EQ(between.size(), 2u);
  EXPECT_EQ(between[0].image2, 1);
  EXPECT_EQ(between[1].image1, 1);
  EXPECT_EQ(between[1].image2, 3);
}

}  // namespace
}  // namespace cairn::reconstruct
