#include "core/promise/view_distance.h"

#include <algorithm>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/core/promise/wall_survey.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr double kRadius = 0.7, kRadiusDeg = 20;

// Some at the same places, some at the same place looking the same way.
std::vector<Pose> SomeViews(int num, uint64_t seed) {
  Random random(seed);
  std::vector<Pose> views;
  for (int i = 0; i < num; ++i) {
    if (i % 7 == 3) {
      views.push_back(views[i / 2]);
      continue;
    }
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(
        random.Uniform(-3, 3), Eigen::Vector3d(0.1, 1, random.Uniform(-0.2, 0.2)).normalized()));
    const Eigen::Vector3d center =
        i % 5 == 1 ? views[i / 3].Center()
                   : Eigen::Vector3d(random.Uniform(-9, 9), random.Uniform(-4, 4), random.Uniform(0, 0.5));
    views.push_back({rotation, -(rotation * center)});
  }
  return views;
}

double SquaredOf(const Pose& a, const Pose& b) { return ViewDistanceSquared(a, b, kRadius, kRadiusDeg); }

TEST(ViewTree, FindsTheNearestThatABruteSearchFinds) {
  for (const int num_views : {1, 8, 9, 100, 500}) {
    const std::vector<Pose> views = SomeViews(num_views, num_views);
    const ViewTree tree(views, kRadius, kRadiusDeg);
    EXPECT_EQ(tree.size(), views.size());
    for (const Pose& pose : SomeViews(20, 77)) {
      std::vector<std::pair<double, int32_t>> order;
      for (int32_t i = 0; i < num_views; ++i) order.emplace_back(SquaredOf(pose, views[i]), i);
      std::sort(order.begin(), order.end());
      std::vector<int32_t> nearest;
      for (size_t n = 0; n < std::min<size_t>(12, order.size()); ++n) nearest.push_back(order[n].second);
      EXPECT_EQ(tree.Nearest(pose, 12), nearest);
      const int32_t except = nearest[0];
      nearest.erase(nearest.begin());
      if (order.size() > 12) nearest.push_back(order[12].second);
      EXPECT_EQ(tree.Nearest(pose, 12, except), nearest);
    }
  }
}

TEST(ViewTree, OfEqualsTheSmallerIsNearer) {
  const std::vector<Pose> views(30);
  const ViewTree tree(views, kRadius, kRadiusDeg);
  EXPECT_THAT(tree.Nearest(views[0], 3), ElementsAre(0, 1, 2));
  EXPECT_THAT(tree.Nearest(views[0], 3, 1), ElementsAre(0, 2, 3));
  EXPECT_THAT(tree.Nearest(views[0], 0), IsEmpty());
  EXPECT_THAT(ViewTree({}, kRadius, kRadiusDeg).Nearest(views[0], 3), IsEmpty());
}

TEST(ViewTree, FindsAllThatAreNear) {
  const std::vector<Pose> views = SomeViews(400, 5);
  const ViewTree tree(views, kRadius, kRadiusDeg);
  for (size_t a = 0; a < 40; ++a) {
    std::vector<int32_t> near, expected_near, there, expected_there;
    const double distance_m = 0.1 * static_cast<double>(a);
    tree.ForNear(a, distance_m, [&](int32_t view, double squared) {
      EXPECT_EQ(squared, SquaredOf(views[a], views[view]));
      near.push_back(view);
    });
    tree.ForPlacesNear(views[a].Center(), distance_m, [&](int32_t view) { there.push_back(view); });
    for (int32_t b = 0; b < std::ssize(views); ++b) {
      if (SquaredOf(views[a], views[b]) < distance_m) expected_near.push_back(b);
      if (CenterErrorM(views[a], views[b]) < distance_m) expected_there.push_back(b);
    }
    std::sort(near.begin(), near.end());
    std::sort(there.begin(), there.end());
    EXPECT_EQ(near, expected_near);
    EXPECT_EQ(there, expected_there);
  }
}

TEST(ViewTree, SquaresAreThoseOfPosesWherePlacesAreNearEnough) {
  const std::vector<Pose> views = SomeViews(60, 9);
  const ViewTree tree(views, kRadius, kRadiusDeg);
  int num_far = 0;
  for (size_t a = 0; a < views.size(); ++a) {
    for (size_t b = 0; b < views.size(); ++b) {
      const double squared = SquaredOf(views[a], views[b]);
      EXPECT_EQ(tree.Squared(a, b), squared);
      EXPECT_EQ(tree.Squared(views[a], b), squared);
      const double up_to = tree.SquaredUpTo(30, a, b);
      const bool is_far = (views[a].Center() - views[b].Center()).norm() > kRadius * std::sqrt(30);
      EXPECT_EQ(up_to, is_far ? std::numeric_limits<double>::infinity() : squared);
      num_far += is_far ? 1 : 0;
    }
  }
  EXPECT_GT(num_far, 100);
}

TEST(ViewDistance, CountsInRadiiOfAView) {
  Classes classes = WallSurvey(3, 0.4);
  AddClass({0, 0, 4}, {1}, 3, &classes);
  classes.images[2].cam_from_world.rotation = Eigen::AngleAxisd(RadFromDeg(30), Eigen::Vector3d::UnitY());
  classes.images[2].cam_from_world.translation.setZero();
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
