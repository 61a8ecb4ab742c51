#include "stages/emit_map/learn_focal.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::emit_map {
namespace {

// Landmarks that level cameras at places of a 4 m square see, each by `num_sights` of them, with noise.
std::vector<std::vector<FloorSight>> Landmarks(int num_landmarks, int num_sights, double focal_px,
                                               double sigma_px = 0.3) {
  Random random(5);
  std::vector<std::vector<FloorSight>> landmarks(num_landmarks);
  for (std::vector<FloorSight>& sights : landmarks) {
    const double far_x = random.Uniform(6, 10);
    const Eigen::Vector2d point(far_x, random.Uniform(-4, 4));
    while (static_cast<int>(sights.size()) < num_sights) {
      const double x = random.Uniform(0, 4), y = random.Uniform(-2, 2), heading = random.Uniform(-0.3, 0.3);
      const Eigen::Vector2d forward(std::cos(heading), std::sin(heading)), right(forward.y(), -forward.x());
      const Eigen::Vector2d to = point - Eigen::Vector2d(x, y);
      const double px = focal_px * right.dot(to) / forward.dot(to) + random.Normal(0, sigma_px);
      // The ray is (px, focal): to the right as seen, ahead by the focal length.
      sights.push_back({{x, y}, heading, {px, 0}, {0, 1}});
    }
  }
  return landmarks;
}

TEST(LearnFocal, FindsTheFocalLengthThatMakesSightsMeet) {
  for (const double focal_px : {200.0, 500.0, 1900.0})
    EXPECT_NEAR(LearnFocal(Landmarks(60, 8, focal_px), 640), focal_px, 0.02 * focal_px);
  EXPECT_NEAR(LearnFocal(Landmarks(60, 8, 500, 0), 640), 500, 0.1);
}

TEST(LearnFocal, NeedsTwentyLandmarksOfFourSights) {
  EXPECT_NEAR(LearnFocal(Landmarks(20, 4, 500, 0), 640), 500, 1);
  EXPECT_EQ(LearnFocal(Landmarks(19, 4, 500, 0), 640), 0);
  EXPECT_EQ(LearnFocal(Landmarks(60, 3, 500, 0), 640), 0);
}

TEST(LearnFocal, AFewWrongSightsDoNotMove) {
  auto landmarks = Landmarks(60, 8, 500);
  for (size_t i = 0; i < landmarks.size(); i += 3) landmarks[i][2].right[0] += 200;
  EXPECT_NEAR(LearnFocal(landmarks, 640), 500, 15);
}

TEST(LearnFocal, IsNoneOutsideOfAFifthToFiveTimesTheWidth) {
  EXPECT_EQ(LearnFocal(Landmarks(60, 8, 5.5 * 640, 0), 640), 0);
  EXPECT_EQ(LearnFocal(Landmarks(60, 8, 0.15 * 640, 0), 640), 0);
}

TEST(LearnFocal, OfManyLandmarksSomeFromTheFirstToTheLastAreUsed) {
  // The first half says one thing, the second another: what is found is of both.
  auto landmarks = Landmarks(1500, 4, 500, 0);
  const auto others = Landmarks(1500, 4, 700, 0);
  EXPECT_NEAR(LearnFocal(landmarks, 640), 500, 1);
  for (size_t i = 400; i < landmarks.size(); ++i) landmarks[i] = others[i];
  EXPECT_NEAR(LearnFocal(landmarks, 640), 700, 1);
}

}  // namespace
}  // namespace cairn::emit_map
