#include "core/geometry/estimate_two_view.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/geometry/relative_pose.h"
#include "tests/core/geometry/seen_by_two.h"

namespace cairn {
namespace {

constexpr EstimateModelOptions kThreeThousandths = {.max_error_rad = 0.003};

// By how much two matrices differ that are known up to scale and sign.
double Differ(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  const Eigen::Matrix3d unit_a = a / a.norm(), unit_b = b / b.norm();
  return std::min((unit_a - unit_b).norm(), (unit_a + unit_b).norm());
}

// x b2 ~ H b1 for points on the plane of SeePoints().
Eigen::Matrix3d TrueHomography(const Pose& pose) {
  return pose.rotation.toRotationMatrix() + pose.translation * Eigen::RowVector3d(0.3, 0, 1) / 4;
}

// Correspondences of the first and of others that lie off both axes by an angle, where nothing is right.
Correspondences WithOthersOffAxis(const Correspondences& first, double angle_deg) {
  Correspondences all = first;
  const double sine = std::sin(RadFromDeg(angle_deg)), cosine = std::cos(RadFromDeg(angle_deg));
  for (int i = 0; i < 200; ++i) {
    const auto at = [&](double turn) {
      return Eigen::Vector3d(sine * std::cos(turn), sine * std::sin(turn), cosine);
    };
    all.Add(at(0.1 * i), at(0.37 * i * i), all.size());
    all.Add({0, 0, 1}, at(0.5 * i), all.size());
    all.Add(at(0.5 * i), {0, 0, 1}, all.size());
  }
  return all;
}

using Estimate = std::optional<Eigen::Matrix3d> (*)(const Correspondences&, const EstimateModelOptions&);

std::optional<Eigen::Matrix3d> EstimateEssentialByEight(const Correspondences& c,
                                                        const EstimateModelOptions& options) {
  return EstimateByEightPoints(c, true, options);
}
std::optional<Eigen::Matrix3d> EstimateFundamentalByEight(const Correspondences& c,
                                                          const EstimateModelOptions& options) {
  return EstimateByEightPoints(c, false, options);
}

TEST(EstimateTwoView, EpipolarGeometryIsFoundAmongOutliers) {
  const SeenByTwo seen = SeePoints(120, 2e-4, 60);
  const Eigen::Matrix3d E = EssentialMatrix(seen.cam2_from_cam1);
  for (const Estimate estimate : {Estimate(EstimateEssentialMatrix), Estimate(EstimateFundamentalMatrix),
                                  Estimate(EstimateEssentialByEight), Estimate(EstimateFundamentalByEight)}) {
    const auto found = estimate(seen.correspondences, kThreeThousandths);
    ASSERT_TRUE(found);
    EXPECT_LT(Differ(*found, E), 0.02);
    EXPECT_NEAR(found->norm(), 1, 1e-9);
    EXPECT_EQ(*estimate(seen.correspondences, kThreeThousandths), *found);
    // What is far off the axes is not looked at.
    EXPECT_EQ(*estimate(WithOthersOffAxis(seen.correspondences, 61), kThreeThousandths), *found);
  }
}

TEST(EstimateTwoView, UpTo60DegreesOffTheAxisAllIsLookedAt) {
  // A camera that went ahead sees points farther off its axis: up to 59 degrees, or up to 63.
  for (const double farthest_deg : {59.0, 63.0}) {
    const Eigen::Vector3d ahead(0, 0, 1);
    Correspondences c;
    for (int i = 0; i < 12; ++i) {
      const double off_deg = farthest_deg - 0.1 * i, around = 2.4 * i;
      const double sine = std::sin(RadFromDeg(off_deg)), cosine = std::cos(RadFromDeg(off_deg));
      const Eigen::Vector3d second(sine * std::cos(around), sine * std::sin(around), cosine);
      c.Add(((10 + 0.7 * (i % 5)) * second + ahead).normalized(), second, i);
    }
    for (const Estimate estimate :
         {Estimate(EstimateEssentialMatrix), Estimate(EstimateFundamentalMatrix),
          Estimate(EstimateEssentialByEight), Estimate(EstimateFundamentalByEight)}) {
      const auto found = estimate(c, kThreeThousandths);
      ASSERT_EQ(found.has_value(), farthest_deg < 60);
      if (found) {
        EXPECT_LT(Differ(*found, EssentialMatrix({Eigen::Quaterniond::Identity(), ahead})), 0.01);
      }
      // Seen the other way round, by a camera that went back.
      std::swap(c.bearings1, c.bearings2);
      EXPECT_EQ(estimate(c, kThreeThousandths).has_value(), farthest_deg < 60);
      std::swap(c.bearings1, c.bearings2);
    }
  }
}

TEST(EstimateTwoView, AnEssentialMatrixHasTwoEqualSingularValues) {
  const SeenByTwo seen = SeePoints(40, 1e-3);
  const auto values = [&](bool is_essential) {
    return Eigen::Vector3d(EstimateByEightPoints(seen.correspondences, is_essential, kThreeThousandths)
                               ->jacobiSvd()
                               .singularValues());
  };
  EXPECT_LT((values(true) - Eigen::Vector3d(M_SQRT1_2, M_SQRT1_2, 0)).norm(), 1e-9);
  EXPECT_GT(values(false)[0] - values(false)[1], 1e-4);
}

TEST(EstimateTwoView, EightPointsAreEnough) {
  for (const Estimate estimate : {Estimate(EstimateEssentialMatrix), Estimate(EstimateFundamentalMatrix),
                                  Estimate(EstimateEssentialByEight), Estimate(EstimateFundamentalByEight)}) {
    const SeenByTwo seen = SeePoints(8, 0);
    const auto found = estimate(seen.correspondences, kThreeThousandths);
    ASSERT_TRUE(found);
    EXPECT_LT(Differ(*found, EssentialMatrix(seen.cam2_from_cam1)), 1e-3);
    EXPECT_FALSE(estimate(SeePoints(7, 0).correspondences, kThreeThousandths));
  }
  EXPECT_TRUE(EstimateHomography(SeePoints(8, 0, 0, true).correspondences, kThreeThousandths));
  EXPECT_FALSE(EstimateHomography(SeePoints(7, 0, 0, true).correspondences, kThreeThousandths));
}

TEST(EstimateTwoView, EightPointsAreEstimatedFromAllThatAgree) {
  // The more agree, the less their noise matters: one sample of eight would be far off.
  const SeenByTwo seen = SeePoints(600, 1e-3, 100);
  const Eigen::Matrix3d E = EssentialMatrix(seen.cam2_from_cam1);
  EXPECT_LT(Differ(*EstimateByEightPoints(seen.correspondences, true, kThreeThousandths), E), 0.05);
  // Of what agrees with a single sample, too.
  EXPECT_LT(Differ(*EstimateByEightPoints(SeePoints(300, 1e-3).correspondences, true,
                                          {.max_error_rad = 0.01, .max_num_iterations = 1}),
                   E),
            0.05);
  // Of one sample, too, where it is free of outliers.
  const EstimateModelOptions one_sample = {.max_error_rad = 0.003, .max_num_iterations = 1};
  EXPECT_TRUE(EstimateByEightPoints(SeePoints(30, 1e-4).correspondences, true, one_sample));
  EXPECT_FALSE(EstimateByEightPoints(SeePoints(30, 1e-4).correspondences, true,
                                     {.max_error_rad = 0.003, .max_num_iterations = 0}));
}

TEST(EstimateTwoView, NothingIsEstimatedOfOnePointOrNone) {
  Correspondences same;
  for (int i = 0; i < 30; ++i) same.Add({0, 0, 1}, Eigen::Vector3d(0.1, 0, 1).normalized(), i);
  for (const Estimate estimate : {Estimate(EstimateEssentialMatrix), Estimate(EstimateFundamentalMatrix),
                                  Estimate(EstimateHomography)}) {
    EXPECT_FALSE(estimate(Correspondences(), kThreeThousandths));
    EXPECT_FALSE(estimate(same, kThreeThousandths));
  }
  EXPECT_FALSE(EstimateByEightPoints(Correspondences(), true, kThreeThousandths));
}

TEST(EstimateTwoView, AHomographyTakesBearingsToTheFront) {
  const SeenByTwo seen = SeePoints(80, 2e-4, 30, true);
  const Eigen::Matrix3d truth = TrueHomography(seen.cam2_from_cam1);
  const auto H = EstimateHomography(seen.correspondences, kThreeThousandths);
  ASSERT_TRUE(H);
  EXPECT_LT((*H - truth / truth.norm()).norm(), 0.003);  // its sign, too
  EXPECT_EQ(*EstimateHomography(WithOthersOffAxis(seen.correspondences, 61), kThreeThousandths), *H);
  // Of a camera that turned.
  Correspondences turned;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.4, Eigen::Vector3d(0.2, 1, 0.1).normalized()).toRotationMatrix();
  for (int i = 0; i < 40; ++i)
    turned.Add(seen.correspondences.bearings1[i], turn * seen.correspondences.bearings1[i], i);
  EXPECT_LT((*EstimateHomography(turned, kThreeThousandths) - turn / turn.norm()).norm(), 1e-4);
  // Bearings that most are taken to the back of: the opposite sign.
  Correspondences behind;
  for (int i = 0; i < 40; ++i) behind.Add(turned.bearings1[i], turned.bearings2[i], i);
  for (int i = 0; i < 60; ++i) behind.Add(turned.bearings1[i % 40], -turned.bearings2[i % 40], i);
  EXPECT_LT((*EstimateHomography(behind, kThreeThousandths) + turn / turn.norm()).norm(), 1e-4);
  // And with most in front again.
  for (int i = 0; i < 30; ++i) behind.Add(turned.bearings1[i], turned.bearings2[i], i);
  EXPECT_LT((*EstimateHomography(behind, kThreeThousandths) - turn / turn.norm()).norm(), 1e-4);
}

TEST(PosesFromHomography, TheTruePoseIsAmongThem) {
  const Pose truth = SeePoints(1, 0).cam2_from_cam1;
  for (const double scale : {1.0, 0.3}) {
    const std::vector<Pose> poses = PosesFromHomography(scale * TrueHomography(truth));
    EXPECT_GE(poses.size(), 2u);
    EXPECT_LE(poses.size(), 4u);
    double nearest = 1;
    for (const Pose& pose : poses) {
      EXPECT_NEAR(pose.translation.norm(), 1, 1e-12);
      const double off = std::min((pose.translation - truth.translation).norm(),
                                  (pose.translation + truth.translation).norm());
      nearest = std::min(nearest, off + pose.rotation.angularDistance(truth.rotation));
    }
    EXPECT_LT(nearest, 1e-6);
  }
}

TEST(PosesFromHomography, ARotationHasNone) {
  EXPECT_TRUE(PosesFromHomography(SeePoints(1, 0).cam2_from_cam1.rotation.toRotationMatrix()).empty());
  EXPECT_TRUE(PosesFromHomography(Eigen::Matrix3d::Zero()).empty());
  EXPECT_TRUE(PosesFromHomography(Eigen::Vector3d(1, 1, 0).asDiagonal()).empty());
  EXPECT_TRUE(PosesFromHomography(Eigen::Matrix3d::Constant(std::nan(""))).empty());
}

}  // namespace
}  // namespace cairn
