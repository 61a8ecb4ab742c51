#include "core/geometry/minimal_pose.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>

#include "tests/core/geometry/random_vector.h"

namespace cairn {
namespace {

Pose RandomPose(Random& random) {
  const Eigen::Vector3d axis = RandomVector(random, 1).normalized();
  return {Eigen::Quaterniond(Eigen::AngleAxisd(random.Uniform(-3, 3), axis)), RandomVector(random, 5)};
}

// Points that a rig sees at 1 to 10 m, each by a camera up to so far from the rig's origin.
template <size_t N>
void LookAt(const Pose& rig_from_world, double extent_m, Random& random, std::array<RigRay, N>* rays,
            std::array<Eigen::Vector3d, N>* points) {
  for (size_t i = 0; i < N; ++i) {
    RigRay& ray = (*rays)[i];
    ray.origin = RandomVector(random, extent_m);
    ray.direction = RandomVector(random, 1).normalized();
    (*points)[i] = rig_from_world.Inverse() * (ray.origin + random.Uniform(1, 10) * ray.direction);
  }
}

// How far the nearest of these poses is from another, metres and radians together.
double Nearest(const MinimalPoses& poses, const Pose& truth) {
  double nearest = 1e9;
  for (const Pose& pose : poses)
    nearest = std::min(nearest, CenterErrorM(pose, truth) + RadFromDeg(RotationErrorDeg(pose, truth)));
  return nearest;
}

// How far points lie from the rays on which a pose puts them, or that they lie behind them.
template <size_t N>
double WorstMiss(const Pose& rig_from_world, const std::array<RigRay, N>& rays,
                 const std::array<Eigen::Vector3d, N>& points) {
  double worst = 0;
  for (size_t i = 0; i < N; ++i) {
    const Eigen::Vector3d to_point = rig_from_world * points[i] - rays[i].origin;
    worst = std::max(worst, (to_point.normalized() - rays[i].direction).norm());
  }
  return worst;
}

TEST(PosesFromThreeRays, TheTruePoseIsAmongThemAndAllPutThePointsOnTheRays) {
  Random random(1);
  int num_found_in_all = 0;
  for (const double extent_m : {2.0, 0.2, 0.02}) {
    int num_found = 0;
    constexpr int kNumTrials = 2000;
    for (int trial = 0; trial < kNumTrials; ++trial) {
      const Pose truth = RandomPose(random);
      std::array<RigRay, 3> rays;
      std::array<Eigen::Vector3d, 3> points;
      LookAt(truth, extent_m, random, &rays, &points);
      const MinimalPoses poses = PosesFromThreeRays(rays, points);
      EXPECT_LE(poses.size(), 8U);
      for (const Pose& pose : poses) EXPECT_LT(WorstMiss(pose, rays, points), 1e-5);
      for (size_t i = 0; i < poses.size(); ++i) {
        MinimalPoses before;
        for (size_t k = 0; k < i; ++k) before.push_back(poses[k]);
        EXPECT_GT(Nearest(before, poses[i]), 1e-7) << "the same twice";
      }
      num_found += Nearest(poses, truth) < 1e-5 ? 1 : 0;
    }
    EXPECT_GE(num_found, 0.985 * kNumTrials) << extent_m;  // some are nearly double
    num_found_in_all += num_found;
  }
  // Of 6000.  Some 20 are found by what eliminated the other depths alone; other processors round otherwise.
  EXPECT_GE(num_found_in_all, 5930);
}

// As landmarks of a far wall are: seen in a small part of the image.
TEST(PosesFromThreeRays, SmallTrianglesFarAwayHaveThemToo) {
  Random random(5);
  for (const double depth_m : {4.0, 10.0, 30.0}) {
    int num_found = 0;
    constexpr int kNumTrials = 1000;
    for (int trial = 0; trial < kNumTrials; ++trial) {
      const Pose truth = RandomPose(random);
      std::array<RigRay, 3> rays;
      std::array<Eigen::Vector3d, 3> points;
      const Eigen::Vector3d middle = depth_m * RandomVector(random, 1).normalized();
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d seen = middle + RandomVector(random, 0.5);
        rays[i].origin = {i == 0 ? 0.0 : 0.12, 0, 0};  // a stereo pair
        rays[i].direction = (seen - rays[i].origin).normalized();
        points[i] = truth.Inverse() * seen;
      }
      const MinimalPoses poses = PosesFromThreeRays(rays, points);
      for (const Pose& pose : poses) EXPECT_LT(WorstMiss(pose, rays, points), 1e-4);
      num_found += Nearest(poses, truth) < 1e-3 * depth_m ? 1 : 0;
    }
    EXPECT_GE(num_found, 0.97 * kNumTrials) << depth_m;
  }
}

TEST(PosesFromThreeRays, OfOneCameraTheyAreThoseOfTheThreePointProblem) {
  Random random(2);
  int num_of_opencv = 0, num_same = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Pose truth = RandomPose(random);
    std::array<RigRay, 3> rays;
    std::array<Eigen::Vector3d, 3> points;
    std::vector<cv::Point3d> cv_points;
    std::vector<cv::Point2d> cv_rays;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d seen(random.Uniform(-1, 1), random.Uniform(-1, 1), 1);
      rays[i].direction = seen.normalized();
      points[i] = truth.Inverse() * Eigen::Vector3d(random.Uniform(1, 10) * seen);
      cv_points.emplace_back(points[i].x(), points[i].y(), points[i].z());
      cv_rays.emplace_back(seen.x(), seen.y());
    }
    std::vector<cv::Mat> rotations, translations;
    cv::solveP3P(cv_points, cv_rays, cv::Matx33d::eye(), cv::noArray(), rotations, translations,
                 cv::SOLVEPNP_AP3P);
    const MinimalPoses poses = PosesFromThreeRays(rays, points);
    for (size_t k = 0; k < rotations.size(); ++k) {
      const Eigen::Vector3d rotation(rotations[k].ptr<double>());
      const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(rotation.norm(), rotation.normalized())),
                      Eigen::Vector3d(translations[k].ptr<double>())};
      if (!(WorstMiss(pose, rays, points) < 1e-6)) continue;  // some lie behind the camera
      ++num_of_opencv;
      num_same += Nearest(poses, pose) < 1e-4 ? 1 : 0;
    }
  }
  EXPECT_GT(num_of_opencv, 500);
  EXPECT_GE(num_same, 0.99 * num_of_opencv);
}

// Over the circle through the three points two of the poses are one: the polynomial only touches zero there.
TEST(PosesFromThreeRays, PosesThatAreDoubleAreFound) {
  int num_found = 0, num_trials = 0;
  for (const double height_m : {0.7, 1.5, 3.0}) {
    for (const double around : {0.1, 0.5, 0.9, 1.3, 1.7, 2.3, 3.9, 5.1}) {
      const Eigen::Vector3d center(std::cos(around), std::sin(around), -height_m);
      std::array<RigRay, 3> rays;
      std::array<Eigen::Vector3d, 3> points;
      for (int i = 0; i < 3; ++i) {
        const double angle = 2 * M_PI * i / 3 + (i == 2 ? 0.3 : 0);
        points[i] = {std::cos(angle), std::sin(angle), 0};
        rays[i].direction = (points[i] - center).normalized();
      }
      const MinimalPoses poses = PosesFromThreeRays(rays, points);
      for (const Pose& pose : poses) EXPECT_LT(WorstMiss(pose, rays, points), 1e-5);
      num_found += Nearest(poses, {Eigen::Quaterniond::Identity(), -center}) < 1e-3 ? 1 : 0;
      ++num_trials;
    }
  }
  EXPECT_GE(num_found, num_trials - 1);
}

TEST(PosesFromThreeRays, NothingIsDeterminedByParallelRaysOrPointsInALine) {
  std::array<RigRay, 3> rays;
  for (int i = 0; i < 3; ++i) rays[i].origin = {static_cast<double>(i), i == 2 ? 1.0 : 0.0, 0};
  const std::array<Eigen::Vector3d, 3> triangle = {Eigen::Vector3d(0, 0, 1), {1, 0, 2}, {2, 1, 3}};
  for (const Pose& pose : PosesFromThreeRays(rays, triangle))
    EXPECT_LT(WorstMiss(pose, rays, triangle), 1e-5);  // those that are found are right
  const std::array<Eigen::Vector3d, 3> line = {Eigen::Vector3d(0, 0, 1), {1, 0, 1}, {2, 0, 1}};
  EXPECT_TRUE(PosesFromThreeRays(rays, line).empty());
  const std::array<Eigen::Vector3d, 3> one = {Eigen::Vector3d(0, 0, 1), {0, 0, 1}, {0, 0, 1}};
  EXPECT_TRUE(PosesFromThreeRays(rays, one).empty());
  std::array<Eigen::Vector3d, 3> no_number = triangle;
  no_number[1].x() = std::nan("");
  EXPECT_TRUE(PosesFromThreeRays(rays, no_number).empty());
}

TEST(PosesFromTwoRays, TheTruePoseIsAmongThemAndAllKeepUpUp) {
  Random random(3);
  for (const double extent_m : {0.0, 0.3}) {
    int num_found = 0;
    constexpr int kNumTrials = 2000;
    for (int trial = 0; trial < kNumTrials; ++trial) {
      const Pose truth = RandomPose(random);
      std::array<RigRay, 2> rays;
      std::array<Eigen::Vector3d, 2> points;
      LookAt(truth, extent_m, random, &rays, &points);
      const Eigen::Vector3d up_in_world = RandomVector(random, 1).normalized();
      const Eigen::Vector3d up_in_rig = truth.rotation * up_in_world;
      const MinimalPoses poses = PosesFromTwoRays(rays, points, up_in_rig, up_in_world);
      EXPECT_LE(poses.size(), 2U);
      for (const Pose& pose : poses) {
        EXPECT_LT(WorstMiss(pose, rays, points), 1e-4);
        EXPECT_LT((pose.rotation * up_in_world - up_in_rig).norm(), 1e-9);
      }
      num_found += Nearest(poses, truth) < 1e-5 ? 1 : 0;
    }
    EXPECT_GE(num_found, 0.995 * kNumTrials) << extent_m;
  }
}

TEST(PosesFromTwoRays, NothingIsDeterminedOnTheHorizonOrByOnePoint) {
  const Eigen::Vector3d up = -Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  const std::array<RigRay, 2> level = {RigRay{{0, 0, 0}, Eigen::Vector3d(0.6, 0, 0.8)},
                                       RigRay{{0, 0, 0}, Eigen::Vector3d(0, 0, 1)}};
  EXPECT_TRUE(PosesFromTwoRays(level, {Eigen::Vector3d(1, 0, 0), {2, 1, 0}}, up, z).empty());
  const RigRay ray{{0, 0, 0}, Eigen::Vector3d(0, 0.6, 0.8)};
  EXPECT_TRUE(PosesFromTwoRays({ray, ray}, {Eigen::Vector3d(1, 0, 0), {1, 0, 0}}, up, z).empty());
  // Points farther apart than rays can put them at one height.
  const std::array<RigRay, 2> steep = {RigRay{{0, 0, 0}, Eigen::Vector3d(0, 1, 0)},
                                       RigRay{{0, 0, 0}, Eigen::Vector3d(0, -1, 0)}};
  EXPECT_TRUE(PosesFromTwoRays(steep, {Eigen::Vector3d(0, 0, 0), {5, 0, 2}}, up, z).empty());
}

}  // namespace
}  // namespace cairn
