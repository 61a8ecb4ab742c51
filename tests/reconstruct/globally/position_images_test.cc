#include "stages/reconstruct/globally/position_images.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/random.h"

namespace cairn::reconstruct {
namespace {

struct Scene {
  std::vector<Eigen::Vector3d> centers, points;
  std::vector<Sight> sights;
};

// Cameras on a straight line, whose directions to each other are all parallel, and points on both sides of
// it, each seen by the cameras within six metres.
Scene MakeCorridor(int num_images, double noise_rad) {
  Random random(5);
  Scene scene;
  for (int i = 0; i < num_images; ++i) scene.centers.emplace_back(0.5 * i, 0, 1);
  for (int k = 0; k < 20 * num_images; ++k)
    scene.points.emplace_back(random.Uniform(-2, 0.5 * num_images + 2), k % 2 ? 1.5 : -1.5,
                              random.Uniform(0, 2.5));
  for (int i = 0; i < num_images; ++i) {
    for (size_t k = 0; k < scene.points.size(); ++k) {
      const Eigen::Vector3d way = scene.points[k] - scene.centers[i];
      if (way.norm() > 6 || way.x() < 0.5) continue;
      Eigen::Vector3d direction = way.normalized();
      for (double& value : direction) value += random.Normal(0, noise_rad);
      scene.sights.push_back({i, static_cast<int>(k), direction.normalized()});
    }
  }
  return scene;
}

// The true ways of a drive.
std::vector<Way> WaysOf(const Scene& scene) {
  std::vector<Way> ways;
  for (int i = 1; i < static_cast<int>(scene.centers.size()); ++i)
    ways.push_back({i - 1, i, scene.centers[i] - scene.centers[i - 1]});
  return ways;
}

// Where the images are, but for what a chain of steps is wrong by, each by a third and more.
std::vector<Eigen::Vector3d> RoughStart(const Scene& scene) {
  Random random(11);
  std::vector<Eigen::Vector3d> start = {Eigen::Vector3d(3, 2, 1)};
  for (const Way& way : WaysOf(scene)) {
    const Eigen::Vector3d shift(random.Normal(0, 0.1), random.Normal(0, 0.1), random.Normal(0, 0.1));
    start.push_back(start.back() + random.Uniform(0.5, 1.5) * way.way + shift);
  }
  return start;
}

Positions Find(const Scene& scene, const std::vector<Eigen::Vector3d>& start, const std::vector<Way>& ways,
               double unit = 0.5) {
  return PositionImages(start, static_cast<int>(scene.points.size()), scene.sights, ways, unit, {});
}

// Root mean square error after the best similarity, as a part of the line's length.
double ErrorOf(const Positions& found, const Scene& scene) {
  Eigen::Matrix3Xd from(3, scene.centers.size()), to(3, scene.centers.size());
  for (size_t i = 0; i < scene.centers.size(); ++i)
    from.col(i) = found.centers[i], to.col(i) = scene.centers[i];
  // A line has no roll: points that many cameras see fix it.
  std::vector<int> count(scene.points.size(), 0);
  for (const Sight& sight : scene.sights) ++count[sight.point];
  for (size_t k = 0; k < scene.points.size(); ++k) {
    if (count[k] < 6) continue;
    from.conservativeResize(3, from.cols() + 1);
    to.conservativeResize(3, to.cols() + 1);
    from.rightCols<1>() = found.points[k];
    to.rightCols<1>() = scene.points[k];
  }
  const Eigen::Matrix4d fit = Eigen::umeyama(from, to, true);
  const Eigen::Matrix3Xd moved = (fit.topLeftCorner<3, 3>() * from).colwise() + fit.topRightCorner<3, 1>();
  const auto num_images = static_cast<Eigen::Index>(scene.centers.size());
  return std::sqrt((moved - to).leftCols(num_images).squaredNorm() / num_images) / (0.5 * num_images);
}

TEST(PositionImages, FindsCamerasOnALineFromARoughStart) {
  const Scene scene = MakeCorridor(25, 0), noisy = MakeCorridor(25, 0.001);
  Positions start;
  start.centers = RoughStart(scene);
  start.points = scene.points;
  EXPECT_GT(ErrorOf(start, scene), 0.05);
  EXPECT_LT(ErrorOf(Find(scene, start.centers, {}), scene), 0.01);
  EXPECT_LT(ErrorOf(Find(noisy, start.centers, {}), noisy), 0.03);
}

// Whatever a unit is: centres, points and factors scale with it.
TEST(PositionImages, UnitsAreFree) {
  const Scene scene = MakeCorridor(12, 0.001);
  std::vector<Eigen::Vector3d> start = RoughStart(scene), larger = start;
  std::vector<Way> ways = WaysOf(scene), larger_ways = ways;
  for (Eigen::Vector3d& center : larger) center *= 1000;
  for (Way& way : larger_ways) way.way *= 1000;
  const Positions found = Find(scene, start, ways), scaled = Find(scene, larger, larger_ways, 500);
  for (int i = 1; i < 12; ++i) {
    const Eigen::Vector3d way = found.centers[i] - found.centers[0];
    EXPECT_LT(((scaled.centers[i] - scaled.centers[0]) / 1000 - way).norm(), 0.01) << i;
  }
}

TEST(PositionImages, WrongSightsHaveLittleSay) {
  Scene scene = MakeCorridor(25, 0.0005);
  Random random(7);
  for (size_t s = 0; s < scene.sights.size(); s += 20)
    scene.sights[s].direction =
        Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1)).normalized();
  EXPECT_LT(ErrorOf(Find(scene, RoughStart(scene), {}), scene), 0.04);
}

// The halves of a drive share no point, and the second goes twice as far as the first, which only ways tell;
// they also give the scale.
TEST(PositionImages, WaysTieThePartsOfADriveAndGiveTheScale) {
  Scene scene = MakeCorridor(24, 0);
  for (int i = 12; i < 24; ++i) scene.centers[i] += Eigen::Vector3d(0.5 * (i - 11), 0, 0);
  scene.sights.clear();
  for (int i = 0; i < 24; ++i) {
    for (size_t k = 0; k < scene.points.size(); ++k) {
      const Eigen::Vector3d way =
          scene.points[k] + Eigen::Vector3d(k % 4 < 2 ? 0 : 6, 0, 0) - scene.centers[i];
      if (way.norm() < 6 && way.x() > 0.5 && (i < 12) == (k % 4 < 2))
        scene.sights.push_back({i, static_cast<int>(k), way.normalized()});
    }
  }
  std::vector<Way> ways = WaysOf(scene);
  Random random(3);
  for (Way& way : ways) way.way *= 1 + random.Normal(0, 0.02);
  const Positions found = Find(scene, RoughStart(scene), ways);
  for (const int i : {3, 5, 11, 12, 23})
    EXPECT_LT((found.centers[i] - found.centers[0] - scene.centers[i] + scene.centers[0]).norm(), 0.15) << i;
}

TEST(PositionImages, AWrongWayHasLittleSay) {
  const Scene scene = MakeCorridor(25, 0);
  std::vector<Way> ways = WaysOf(scene);
  ways[12].way += Eigen::Vector3d(0, 3, 0);
  const Positions found = Find(scene, scene.centers, ways);
  EXPECT_LT((found.centers[24] - found.centers[0] - Eigen::Vector3d(12, 0, 0)).norm(), 0.3);
}

TEST(PositionImages, SameInputSameBytes) {
  const Scene scene = MakeCorridor(10, 0.001);
  const Positions first = Find(scene, RoughStart(scene), WaysOf(scene)),
                  second = Find(scene, RoughStart(scene), WaysOf(scene));
  for (int i = 0; i < 10; ++i) EXPECT_EQ(first.centers[i], second.centers[i]);
}

}  // namespace
}  // namespace cairn::reconstruct
