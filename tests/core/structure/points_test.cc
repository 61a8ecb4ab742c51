#include "core/structure/points.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <vector>

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

TEST(DividePoints, IntoWindowsThatHaveEachOnceAndNoMoreThanTheyMay) {
  Random of_places(3);
  std::vector<Eigen::Vector2d> positions;
  std::vector<int32_t> chosen;
  for (int i = 0; i < 500; ++i) {
    positions.emplace_back(of_places.Uniform(0, 30), of_places.Uniform(0, 10));
    if (i % 3 != 0) chosen.push_back(i);
  }
  std::set<std::vector<int32_t>> firsts;
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    std::vector<int32_t> all;
    const auto windows = DividePoints(positions, chosen, 40, &random);
    for (const std::vector<int32_t>& window : windows) {
      EXPECT_LE(window.size(), 40u);
      EXPECT_GE(window.size(), 10u);  // less than a window is not divided
      EXPECT_TRUE(std::is_sorted(window.begin(), window.end()));
      all.insert(all.end(), window.begin(), window.end());
      double low = 30, high = 0;  // of a floor of three to one nothing is wider than half of it
      for (const int32_t s : window) {
        low = std::min(low, positions[s].x());
        high = std::max(high, positions[s].x());
      }
      EXPECT_LT(high - low, 16);
    }
    std::sort(all.begin(), all.end());
    EXPECT_EQ(all, chosen);
    firsts.insert(windows.front());
  }
  EXPECT_EQ(firsts.size(), 3u);  // other borders each time
  Random random(1);
  EXPECT_TRUE(DividePoints(positions, {}, 40, &random).empty());
  EXPECT_EQ(DividePoints(positions, {7, 5}, 2, &random), (std::vector<std::vector<int32_t>>{{5, 7}}));
  // All at one place.
  EXPECT_EQ(
      DividePoints(std::vector<Eigen::Vector2d>(8, {1, 1}), {0, 1, 2, 3, 4, 5, 6, 7}, 1, &random).size(), 8u);
}

TEST(DividePoints, AcrossTheLongestSideOfThree) {
  Random of_places(4), random(1);
  std::vector<Eigen::Vector3d> points;
  std::vector<int32_t> idxs;
  for (int i = 0; i < 64; ++i) {
    points.emplace_back(of_places.Uniform(0, 3), of_places.Uniform(0, 1), of_places.Uniform(0, 9));
    idxs.push_back(i);
  }
  const auto windows = DividePoints(points, idxs, 40, &random);
  ASSERT_EQ(windows.size(), 2u);
  double highest = 0, lowest = 9;
  for (const int32_t i : windows[0]) highest = std::max(highest, points[i].z());
  for (const int32_t i : windows[1]) lowest = std::min(lowest, points[i].z());
  EXPECT_LT(highest, lowest);
}

}  // namespace
}  // namespace cairn
