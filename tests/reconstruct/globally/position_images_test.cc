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

std::vector<Step> StepsOf(int num_images) {
  std::vector<Step> steps;
  for (int i = 1; i < num_images; ++i) steps.push_back({i - 1, i, std::nullopt});
  return steps;
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

TEST(PositionImages, FindsCamerasOnALineFromNowhere) {
  const Scene scene = MakeCorridor(25, 0);
  const auto positions = PositionImages(25, static_cast<int>(scene.points.size()), scene.sights, {}, {});
  EXPECT_LT(ErrorOf(positions, scene), 0.01);
  const Scene noisy = MakeCorridor(25, 0.001);
  EXPECT_LT(ErrorOf(PositionImages(25, static_cast<int>(noisy.points.size()), noisy.sights, {}, {}), noisy),
            0.03);
}

TEST(PositionImages, WrongSightsHaveLittleSay) {
  Scene scene = MakeCorridor(25, 0.0005);
  Random random(7);
  for (size_t s = 0; s < scene.sights.size(); s += 20)
    scene.sights[s].direction =
        Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1)).normalized();
  EXPECT_LT(ErrorOf(PositionImages(25, static_cast<int>(scene.points.size()), scene.sights, {}, {}), scene),
            0.04);
}

// The two halves of a drive share no point: only its steps tell how large one is beside the other.
TEST(PositionImages, StepsTieThePartsOfADrive) {
  Scene scene = MakeCorridor(24, 0);
  std::erase_if(scene.sights,
                [&](const Sight& sight) { return (sight.image < 12) != (sight.point % 4 < 2); });
  const auto ratio = [&](bool is_drive) {
    const auto found = PositionImages(24, static_cast<int>(scene.points.size()), scene.sights,
                                      is_drive ? StepsOf(24) : std::vector<Step>(), {});
    return (found.centers[11] - found.centers[2]).norm() / (found.centers[23] - found.centers[14]).norm();
  };
  EXPECT_NEAR(ratio(true), 1, 0.05);
  EXPECT_GT(std::abs(std::log(ratio(false))), 0.1);
}

// The same, but the second half goes twice as far as the first, which only measured ways tell; they also give
// the scale.
TEST(PositionImages, MeasuredWaysTieThePartsAndGiveTheScale) {
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
  std::vector<Step> steps = StepsOf(24);
  Random random(3);
  for (Step& step : steps)
    step.way = (1 + random.Normal(0, 0.02)) * (scene.centers[step.to] - scene.centers[step.from]);
  // One that is not measured, and one over two images instead.
  steps[4].way.reset();
  steps.insert(steps.begin() + 4, {3, 5, scene.centers[5] - scene.centers[3]});
  const auto found = PositionImages(24, static_cast<int>(scene.points.size()), scene.sights, steps, {});
  for (const int i : {3, 5, 11, 12, 23})
    EXPECT_LT((found.centers[i] - found.centers[0] - scene.centers[i] + scene.centers[0]).norm(), 0.15) << i;
}

TEST(PositionImages, AWrongWayHasLittleSay) {
  const Scene scene = MakeCorridor(25, 0);
  std::vector<Step> steps = StepsOf(25);
  for (Step& step : steps) step.way = scene.centers[step.to] - scene.centers[step.from];
  *steps[12].way += Eigen::Vector3d(0, 3, 0);
  const auto found = PositionImages(25, static_cast<int>(scene.points.size()), scene.sights, steps, {});
  EXPECT_LT((found.centers[24] - found.centers[0] - Eigen::Vector3d(12, 0, 0)).norm(), 0.3);
}

TEST(PositionImages, SameSeedSameBytes) {
  const Scene scene = MakeCorridor(10, 0.001);
  const auto first = PositionImages(10, static_cast<int>(scene.points.size()), scene.sights, StepsOf(10), {});
  const auto second =
      PositionImages(10, static_cast<int>(scene.points.size()), scene.sights, StepsOf(10), {});
  for (int i = 0; i < 10; ++i) EXPECT_EQ(first.centers[i], second.centers[i]);
}

}  // namespace
}  // namespace cairn::reconstruct
