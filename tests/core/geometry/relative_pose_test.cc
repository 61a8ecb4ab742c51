#include "core/geometry/relative_pose.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/SVD>

#include "tests/core/geometry/random_vector.h"
#include "tests/core/geometry/seen_by_two.h"

namespace cairn {
namespace {

// The angles by which rotation and direction of the translation differ, together.
double OffBy(const Pose& a, const Pose& b) {
  return a.rotation.angularDistance(b.rotation) +
         std::atan2(a.translation.cross(b.translation).norm(), a.translation.dot(b.translation));
}

Pose Turned(const Pose& pose, const Eigen::Vector3d& by, const Eigen::Vector3d& translation) {
  Pose turned = pose;
  if (by.norm() > 0)
    turned.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(by.norm(), by.normalized())) * pose.rotation;
  turned.translation = (pose.translation + translation).normalized();
  return turned;
}

double CauchyCost(const Pose& pose, const Correspondences& c, double scale_rad) {
  double cost = 0;
  for (int i = 0; i < c.size(); ++i) {
    cost += std::log1p(SquaredSampsonError(EssentialMatrix(pose), c.bearings1[i], c.bearings2[i]) /
                       (scale_rad * scale_rad));
  }
  return cost;
}

TEST(EssentialMatrix, VanishesForBothBearingsOfAPoint) {
  const SeenByTwo seen = SeePoints(20, 0);
  Pose pose = seen.cam2_from_cam1;
  pose.translation *= 5;  // its length does not matter
  const Eigen::Matrix3d E = EssentialMatrix(pose);
  for (int i = 0; i < 20; ++i)
    EXPECT_NEAR(seen.correspondences.bearings2[i].dot(E * seen.correspondences.bearings1[i]), 0, 1e-12);
  EXPECT_LT((E.jacobiSvd().singularValues() - Eigen::Vector3d(1, 1, 0)).norm(), 1e-12);
}

TEST(RefineRelativePose, FindsThePoseFromNearby) {
  const SeenByTwo seen = SeePoints(60, 0);
  const Pose start = Turned(seen.cam2_from_cam1, {0.02, -0.03, 0.01}, {0.05, 0.02, -0.04});
  EXPECT_GT(OffBy(start, seen.cam2_from_cam1), 0.05);
  EXPECT_EQ(OffBy(RefineRelativePose(start, seen.correspondences, 0.01, 0), start), OffBy(start, start));
  EXPECT_LT(OffBy(RefineRelativePose(start, seen.correspondences, 0.1, 3), seen.cam2_from_cam1), 1e-3);
  const Pose refined = RefineRelativePose(start, seen.correspondences, 0.1, 12);
  EXPECT_LT(OffBy(refined, seen.cam2_from_cam1), 1e-7);
  EXPECT_NEAR(refined.translation.norm(), 1, 1e-12);
}

TEST(RefineRelativePose, FindsItOfBearingsAllAround) {
  Random random(9);
  Pose truth = SeePoints(1, 0).cam2_from_cam1;
  Correspondences c;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d point = 4 * RandomVector(random, 1);
    c.Add(point.normalized(), (truth * point).normalized(), i);
  }
  const Pose start = Turned(truth, {0.02, -0.03, 0.01}, {0.05, 0.02, -0.04});
  EXPECT_LT(OffBy(RefineRelativePose(start, c, 0.1, 4), truth), 1e-5);
}

TEST(RefineRelativePose, ItsCostIsLeast) {
  const SeenByTwo seen = SeePoints(200, 5e-4, 30);
  for (const double scale_rad : {5e-4, 0.001}) {
    const Pose pose = RefineRelativePose(seen.cam2_from_cam1, seen.correspondences, scale_rad, 60);
    EXPECT_LT(OffBy(pose, seen.cam2_from_cam1), 0.01);
    const double least = CauchyCost(pose, seen.correspondences, scale_rad);
    for (int axis = 0; axis < 3; ++axis) {
      for (const double by : {-0.001, 0.001}) {
        const Eigen::Vector3d change = by * Eigen::Vector3d::Unit(axis);
        const Eigen::Vector3d none = Eigen::Vector3d::Zero();
        EXPECT_LT(least, CauchyCost(Turned(pose, change, none), seen.correspondences, scale_rad)) << axis;
        // The direction's own axis is no change.
        if (std::abs(pose.translation[axis]) > 0.9) continue;
        EXPECT_LT(least, CauchyCost(Turned(pose, none, 4 * change), seen.correspondences, scale_rad)) << axis;
      }
    }
  }
}

TEST(RefineRelativePose, WithoutCorrespondencesItStays) {
  Pose start = SeePoints(1, 0).cam2_from_cam1;
  const Pose of_length_one = start;
  start.translation *= 3;
  const Pose refined = RefineRelativePose(start, Correspondences(), 0.01, 3);
  EXPECT_LT((refined.translation - of_length_one.translation).norm(), 1e-12);
  EXPECT_LT((refined.rotation.coeffs() - start.rotation.coeffs()).norm(), 1e-12);
}

TEST(RefineRotation, TurnsTheBearingsOfMost) {
  Random random(5);
  const Eigen::Quaterniond truth(Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, -2, 0.5).normalized()));
  Correspondences exact, with_outliers;
  for (int i = 0; i < 80; ++i) {
    const Eigen::Vector3d bearing =
        Moved(Eigen::Vector3d(random.Uniform(-1, 1), random.Uniform(-1, 1), 1).normalized(), 0, &random);
    exact.Add(bearing, truth * bearing, i);
    const Eigen::Vector3d elsewhere = Moved(truth * bearing, 0.2, &random);
    with_outliers.Add(bearing, i < 50 ? Moved(truth * bearing, 1e-4, &random) : elsewhere, i);
  }
  const Eigen::Quaterniond start =
      Eigen::Quaterniond(Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX())) * truth;
  EXPECT_LT(RefineRotation(start, exact, 0.01, 1).angularDistance(truth), 1e-7);
  EXPECT_NEAR(RefineRotation(start, exact, 0.01, 0).angularDistance(truth), 0.03, 1e-7);
  // With few hundredths all count nearly alike, with few ten thousandths outliers hardly do.
  EXPECT_LT(RefineRotation(start, with_outliers, 3e-4, 60).angularDistance(truth), 1e-4);
  EXPECT_GT(RefineRotation(start, with_outliers, 10, 60).angularDistance(truth), 1e-3);
}

TEST(PoseFromEssentialMatrix, PutsMostPointsInFrontOfBothCameras) {
  Random random(6);
  for (int trial = 0; trial < 50; ++trial) {
    Pose truth;
    truth.rotation = Eigen::AngleAxisd(random.Uniform(0, 0.5), RandomVector(random, 1).normalized());
    truth.translation = RandomVector(random, 1).normalized();
    Correspondences c;
    while (c.size() < 30) {
      // Bearings of rays whose points lie in front; of the last ten, behind both.
      const Eigen::Vector3d point = 4 * RandomVector(random, 1);
      const double sign = c.size() < 20 ? 1 : -1;
      c.Add(sign * point.normalized(), sign * (truth * point).normalized(), c.size());
    }
    for (const double scale : {1.0, -1.0, 3.0, -0.2}) {
      const Pose pose = PoseFromEssentialMatrix(scale * EssentialMatrix(truth), c);
      EXPECT_LT(OffBy(pose, truth), 1e-6) << trial << " " << scale;
      EXPECT_NEAR(pose.translation.norm(), 1, 1e-12);
    }
  }
}

TEST(PoseFromEssentialMatrix, OnePointTellsTheFourPosesApart) {
  Random random(8);
  for (int trial = 0; trial < 200; ++trial) {
    Pose truth;
    truth.rotation = Eigen::AngleAxisd(random.Uniform(0, 3), RandomVector(random, 1).normalized());
    truth.translation = RandomVector(random, 1).normalized();
    const Eigen::Vector3d point = 4 * RandomVector(random, 1);
    Correspondences c;
    c.Add(point.normalized(), (truth * point).normalized(), 0);
    EXPECT_LT(OffBy(PoseFromEssentialMatrix(EssentialMatrix(truth), c), truth), 1e-6) << trial;
  }
}

// Rays that meet in front of one camera and behind the other are in front of none of the two.
TEST(PoseFromEssentialMatrix, PointsInFrontOfOneCameraDoNotCount) {
  Pose truth;
  truth.translation = Eigen::Vector3d(-1, 0, 0);
  Correspondences c;
  // To a point at (0.5, 0, 2), between the cameras, in front of both: 3 of these.
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d point(0.5, 0.1 * i, 2);
    c.Add(point.normalized(), (truth * point).normalized(), i);
  }
  // Two whose rays meet behind the second camera alone: as of a camera that was turned by half a turn about
  // the baseline.
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d point(0.5, 0.1 * i - 0.5, 2);
    c.Add(point.normalized(), -(truth * point).normalized(), 3 + i);
  }
  EXPECT_LT(OffBy(PoseFromEssentialMatrix(EssentialMatrix(truth), c), truth), 1e-6);
}

}  // namespace
}  // namespace cairn
