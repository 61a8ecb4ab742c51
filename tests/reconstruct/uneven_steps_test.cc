#include "stages/reconstruct/uneven_steps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::reconstruct {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// Images at these places along x, in the order of their names, listed backwards; turned by as many degrees
// from one to the next as `turns_deg` has, where it has any.
ColmapModel DriveOf(const std::vector<double>& steps, const std::vector<double>& turns_deg = {}) {
  ColmapModel model;
  double x = 0, heading_deg = 0;
  for (size_t i = 0; i <= steps.size(); ++i) {
    ModelImage image;
    image.name = fmt::format("{}.jpg", i);
    image.cam_from_world.rotation = Eigen::AngleAxisd(RadFromDeg(heading_deg), Eigen::Vector3d::UnitY());
    image.cam_from_world.translation = image.cam_from_world.rotation * Eigen::Vector3d(-x, 0, 0);
    model.images.insert(model.images.begin(), image);
    if (i < steps.size()) x += steps[i];
    if (i < turns_deg.size()) heading_deg += turns_deg[i];
  }
  return model;
}

TEST(UnevenSteps, SayNothingWhereStepsAreEven) {
  std::vector<double> steps(100, 0.5);
  EXPECT_EQ(UnevenSteps(DriveOf(steps)), "");
  EXPECT_EQ(UnevenSteps({}), "");
  for (int i = 30; i < 55; ++i) steps[i] = 0.13;  // 3.8 times as short
  EXPECT_EQ(UnevenSteps(DriveOf(steps)), "");
  for (int i = 30; i < 42; ++i) steps[i] = 0;  // it stands, over fewer than half of 25 steps
  EXPECT_EQ(UnevenSteps(DriveOf(steps)), "");
}

TEST(UnevenSteps, NameThePieceThatDiffersMost) {
  std::vector<double> steps(100, 0.5);
  for (int i = 30; i < 55; ++i) steps[i] = 0.1;
  EXPECT_THAT(UnevenSteps(DriveOf(steps)),
              AllOf(HasSubstr("5.0 times as short as elsewhere"), HasSubstr("from 18.jpg to 43.jpg"),
                    HasSubstr("odometry.txt")));
  for (int i = 75; i < 100; ++i) steps[i] = 4;
  EXPECT_THAT(UnevenSteps(DriveOf(steps)), HasSubstr("8.0 times as long as elsewhere"));
}

TEST(UnevenSteps, LookAtTheLastStepsToo) {
  std::vector<double> steps(100, 0.5);
  for (int i = 87; i < 100; ++i) steps[i] = 0.1;  // 13 of the last 25
  EXPECT_THAT(UnevenSteps(DriveOf(steps)), HasSubstr("from 75.jpg to 100.jpg"));
}

TEST(UnevenSteps, AreThoseOfACameraThatDoesNotTurn) {
  std::vector<double> steps(100, 0.5), turns_deg(100, 0.2);
  for (int i = 30; i < 60; ++i) steps[i] = 0.01;
  EXPECT_NE(UnevenSteps(DriveOf(steps, turns_deg)), "");
  for (int i = 30; i < 60; ++i) turns_deg[i] = 0.9;  // as a camera that goes straight on may
  EXPECT_NE(UnevenSteps(DriveOf(steps, turns_deg)), "");
  for (int i = 30; i < 60; ++i) turns_deg[i] = 1.1;
  EXPECT_EQ(UnevenSteps(DriveOf(steps, turns_deg)), "");
  for (double& turn_deg : turns_deg) turn_deg = 10;  // keyframes of a film that turns all the way
  EXPECT_EQ(UnevenSteps(DriveOf(steps, turns_deg)), "");
  for (int i = 75; i < 100; ++i) steps[i] = 4 + 0.05 * (i - 87);  // after the turn
  EXPECT_THAT(UnevenSteps(DriveOf(steps, turns_deg)),
              AllOf(HasSubstr("from 75.jpg to 100.jpg"), HasSubstr("8.0 times as long as elsewhere")));
}

TEST(UnevenSteps, NeedFiftySteps) {
  std::vector<double> steps(50, 0.5);
  for (int i = 0; i < 20; ++i) steps[i] = 0.1;
  EXPECT_NE(UnevenSteps(DriveOf(steps)), "");
  steps.pop_back();
  EXPECT_EQ(UnevenSteps(DriveOf(steps)), "");
}

}  // namespace
}  // namespace cairn::reconstruct
