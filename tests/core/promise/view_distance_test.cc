#include "core/promise/view_distance.h"

#include <gtest/gtest.h>

#include "tests/core/promise/wall_survey.h"

namespace cairn {
namespace {

TEST(ViewDistance, CountsInRadiiOfAView) {
  Classes classes = WallSurvey(3, 0.4);
  AddClass({0, 0, 4}, {1}, 3, &classes);
  classes.images[2].cam_from_world =
      Pose{Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(30), Eigen::Vector3d::UnitY())), {}};
  const ViewDistance distance(classes, {.same_view_ratio = 0.1, .same_view_deg = 15});
  EXPECT_DOUBLE_EQ(distance.depth(), 4);
  EXPECT_DOUBLE_EQ(distance(0, 0), 0);
  EXPECT_NEAR(distance(0, 1), 1, 1e-12);  // a tenth of 4 m
  EXPECT_NEAR(distance(0, 2), 2, 1e-9);   // twice 15 degrees
  EXPECT_NEAR(distance.Squared(1, 2), 5, 1e-9);
  EXPECT_DOUBLE_EQ(distance(2, 1), distance(1, 2));
}

TEST(ViewDistance, DepthIsTheMedianOverObservations) {
  Classes classes = WallSurvey(2, 0);
  AddClass({0, 0, 1}, {1}, 3, &classes);
  AddClass({0, 0, 3}, {1, 2}, 3, &classes);
  AddClass({0, 0, 9}, {2, 77}, 3, &classes);  // image 77 does not exist
  EXPECT_DOUBLE_EQ(ViewDistance(classes, {}).depth(), 3);
  classes.classes.clear();
  EXPECT_DOUBLE_EQ(ViewDistance(classes, {}).depth(), 1);
}

TEST(ViewDistance, TurnsThatRoundingMakesLongerThanAUnitAreNone) {
  Classes classes = WallSurvey(2, 0);
  classes.images[1].cam_from_world.rotation.coeffs() *= -(1 + 1e-15);
  EXPECT_EQ(ViewDistance(classes, {})(0, 1), 0);
}

}  // namespace
}  // namespace cairn
