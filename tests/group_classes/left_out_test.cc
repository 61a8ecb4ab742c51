#include "stages/group_classes/adjust/left_out.h"

#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/group_classes/circle.h"

namespace cairn::group_classes {
namespace {

using testing::Each;

double Sum(const LeftOutErrors& errors) { return std::accumulate(errors.begin(), errors.end(), 0.0); }

// Index of the observation of a point that is left out, in the order of observations.
size_t LeftOutOf(const BundleProblem& problem, int point) {
  const auto is_of = [&](int p) { return [p](const auto& o) { return o.point_idx == p; }; };
  const auto& all = problem.observations;
  const auto first = std::find_if(all.begin(), all.end(), is_of(point)) - all.begin();
  const auto count = std::count_if(all.begin(), all.end(), is_of(point));
  return static_cast<size_t>(first + point % count);
}

void MovePixel(BundleProblem::Observation* observation, const Eigen::Vector2d& by) {
  observation->pixel += by;
  observation->ray = *MakePixelRay(Lens(), observation->pixel);
}

TEST(LeaveOut, OneKeypointOfEachPointErrsByItsNoise) {
  const Circle circle = MakeCircle(Lens(), Lens(), 0.5, {});
  const LeftOutErrors errors = LeaveOut({}, circle.problem);
  ASSERT_EQ(errors.size(), 12u);
  // Two coordinates of each of 150 points, and what ten others leave open of the point.
  EXPECT_GT(Sum(errors) / 150, 1.8);
  EXPECT_LT(Sum(errors) / 150, 2.9);
  for (const double of_image : errors) EXPECT_GT(of_image, 5);
  EXPECT_EQ(errors, LeaveOut({}, circle.problem));
  BundleProblem exact = MakeCircle(Lens(), Lens(), 1e-6, {}).problem;
  for (BundleProblem::Observation& observation : exact.observations) observation.sigma_px = 0.5;
  EXPECT_LT(Sum(LeaveOut({}, exact)), 1e-6);
}

TEST(LeaveOut, WhatIsLeftOutPullsNothingAndCountsNoMoreThanAnOutlier) {
  const Circle circle = MakeCircle(Lens(), Lens(), 0.5, {});
  const LeftOutErrors before = LeaveOut({}, circle.problem);
  BundleProblem problem = circle.problem;
  const size_t out = LeftOutOf(problem, 7);
  MovePixel(&problem.observations[out], {25, -20});
  const LeftOutErrors after = LeaveOut({}, problem);
  const int image = problem.observations[out].image_idx;
  for (int i = 0; i < 12; ++i) {
    if (i != image) EXPECT_DOUBLE_EQ(after[i], before[i]) << i;
  }
  EXPECT_GT(after[image], before[image] + 8);
  EXPECT_LE(after[image], before[image] + 16);
  // One that is not left out pulls.
  problem = circle.problem;
  MovePixel(&problem.observations[out == 0 ? 1 : out - 1], {3, -3});
  EXPECT_NE(LeaveOut({}, problem), before);
}

TEST(LeaveOut, ItDoesNotMatterWherePointsBeginHoweverLooselyTheSurveyIsSolved) {
  const Circle circle = MakeCircle(Lens(), Lens(), 0.5, {});
  BundleProblem moved = circle.problem;
  for (size_t i = 0; i < moved.points.size(); ++i)
    moved.points[i] += 0.3 * Eigen::Vector3d(i % 3 - 1.0, i % 5 - 2.0, i % 7 - 3.0).normalized();
  const double converged =
      Sum(LeaveOut({.max_num_iterations = 200, .function_tolerance = 1e-9}, circle.problem));
  EXPECT_NEAR(Sum(LeaveOut({.max_num_iterations = 200, .function_tolerance = 0.3}, moved)) / converged, 1,
              1e-3);
}

TEST(LeaveOut, PointsOfFourAreTheFirstOfWhichOneIsLeftOut) {
  Circle circle = MakeCircle(Lens(), Lens(), 0.5, {});
  std::vector<BundleProblem::Observation> four, three;
  std::vector<int> count(circle.points.size(), 0);
  for (const BundleProblem::Observation& observation : circle.problem.observations) {
    const int number = count[observation.point_idx]++;
    if (number < 4) four.push_back(observation);
    if (number < 3) three.push_back(observation);
  }
  circle.problem.observations = three;
  EXPECT_THAT(LeaveOut({}, circle.problem), Each(0.0));
  circle.problem.observations = four;
  EXPECT_GT(Sum(LeaveOut({}, circle.problem)), 150);
}

TEST(GainOf, IsThePartByWhichErrorsShrinkAndItsErrorOverImages) {
  BundleProblem problem;
  problem.images.resize(3);
  problem.images[2].camera_idx = 1;
  const LeftOutErrors before = {10, 6, 4}, after = {7, 2, 5};
  const LeftOutGain all = GainOf(problem, before, after, -1);
  EXPECT_DOUBLE_EQ(all.part, (3 + 4 - 1) / 20.0);
  EXPECT_DOUBLE_EQ(all.standard_error, std::sqrt(9 + 16 + 1.0) / 20);
  const LeftOutGain first = GainOf(problem, before, after, 0);
  EXPECT_DOUBLE_EQ(first.part, 7 / 16.0);
  EXPECT_DOUBLE_EQ(first.standard_error, 5 / 16.0);
  EXPECT_DOUBLE_EQ(GainOf(problem, before, after, 1).part, -0.25);
  EXPECT_EQ(GainOf(problem, before, after, 2).part, 0);
  EXPECT_EQ(GainOf(problem, {0, 0, 0}, {0, 0, 0}, -1).standard_error, 0);
}

}  // namespace
}  // namespace cairn::group_classes
