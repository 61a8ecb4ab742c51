#include "core/structure/point_grid.h"

#include <set>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

TEST(PointGrid, FindsWhatBruteForceFinds) {
  Random random(1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 500; ++i)
    points.emplace_back(random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(-2, 2));
  points.push_back(points.front());  // two at one place
  points.emplace_back(-2e5, 2e5, 0);
  for (const double side : {0.3, 1.0}) {
    const PointGrid grid(points, side);
    for (const Eigen::Vector3d& place : points) {
      std::set<int> found, expected;
      grid.ForNear(place, [&](int index, double distance) {
        EXPECT_EQ(distance, (points[index] - place).norm());
        EXPECT_TRUE(found.insert(index).second);
      });
      for (size_t i = 0; i < points.size(); ++i) {
        if ((points[i] - place).norm() <= side) expected.insert(static_cast<int>(i));
      }
      ASSERT_EQ(found, expected);
    }
  }
}

TEST(PointGrid, OnTheSideIsNear) {
  const std::vector<Eigen::Vector3d> points = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1.5}};
  int num_found = 0;
  PointGrid(points, 1).ForNear({0, 0, 0}, [&](int, double) { ++num_found; });
  EXPECT_EQ(num_found, 2);
}

}  // namespace
}  // namespace cairn
