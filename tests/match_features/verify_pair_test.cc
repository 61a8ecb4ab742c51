#include "stages/match_features/two_views/verify_pair.h"

#include <limits>

#include <gtest/gtest.h>

#include "core/geometry/two_view_error.h"
#include "tests/match_features/two_view_scene.h"

namespace cairn::match_features {
namespace {

TwoViewGeometry Verify(const TwoViewScene& scene, std::optional<Pose> stated1, std::optional<Pose> stated2,
                       const VerifyPairOptions& options = {}) {
  return VerifyPair(scene.View1(stated1), scene.View2(stated2), scene.matches, options);
}
TwoViewGeometry VerifyPosed(const TwoViewScene& scene) {
  return Verify(scene, scene.cam1_from_world, scene.cam2_from_world);
}
TwoViewGeometry VerifyUnposed(const TwoViewScene& scene) { return Verify(scene, std::nullopt, std::nullopt); }

TEST(VerifyPair, KnownPosesKeepTrueMatchesAndDropMostOutliers) {
  const TwoViewScene scene = MakeTwoViewScene({.num_outliers = 100, .noise_px = 0.5});
  const TwoViewGeometry geometry = VerifyPosed(scene);
  EXPECT_EQ(geometry.config, TwoViewConfig::kCalibrated);
  EXPECT_GE(NumTrueInliers(geometry, 100), 98);
  EXPECT_LE(geometry.inliers.size(), 100u + 8u);  // an outlier may lie on its epipolar line by chance
}

TEST(VerifyPair, WrongStatedPoseIsRefinedWithinItsNoise) {
  const TwoViewScene scene = MakeTwoViewScene({.num_points = 200, .num_outliers = 50});
  Pose wrong = scene.cam2_from_world;
  wrong.translation += Eigen::Vector3d(0.02, -0.03, 0.02);
  wrong.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(0.008, Eigen::Vector3d(0.6, 0.8, 0))) * wrong.rotation;
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, wrong);
  EXPECT_GE(NumTrueInliers(geometry, 200), 195);
  for (int i = 0; i < 200; ++i) {  // E explains the true points better than the stated pose does
    EXPECT_LT(std::sqrt(SquaredSampsonError(geometry.E, scene.bearings1[i], scene.bearings2[i])) * 500, 2.5);
  }
}

TEST(VerifyPair, AliasedMatchesThatContradictTheStatedPosesAreRefused) {
  // The second camera saw an identical place: its matches fit a pose, but not the stated one.
  const TwoViewScene scene = MakeTwoViewScene({});
  Pose elsewhere = scene.cam2_from_world;
  elsewhere.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX())) * elsewhere.rotation;
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, elsewhere);
  EXPECT_EQ(geometry.config, TwoViewConfig::kDegenerate);
  EXPECT_TRUE(geometry.inliers.empty());
}

TEST(VerifyPair, MatchesThatMeetBehindTheCamerasAreRefused) {
  // The stated baseline points the other way: the same epipolar lines, but rays that diverge by 8 degrees.
  const TwoViewScene scene = MakeTwoViewScene({.turn_rad = 0});
  Pose stated = scene.cam2_from_world;
  EXPECT_EQ(Verify(scene, scene.cam1_from_world, stated).config, TwoViewConfig::kCalibrated);
  stated.translation *= -1;
  EXPECT_EQ(Verify(scene, scene.cam1_from_world, stated).config, TwoViewConfig::kDegenerate);
}

TEST(VerifyPair, LookAlikesOfViewsBackToBackAreRefused) {
  //   ===========      Both walls have the same frieze at the height of the cameras, which stand side by side
  //        ^ 1         back to back: all of it lies on one epipolar line of the stated poses.
  //          2 v
  //   ===========
  TwoViewScene scene = MakeTwoViewScene({.is_flat = true, .turn_rad = 0});
  scene.cam2_from_world.translation = {-0.5, 0, 0};
  for (size_t i = 0; i < scene.matches.size(); ++i) {
    scene.keypoints1[i].y = scene.keypoints2[i].y = 239.0F + static_cast<float>(i % 3);
    scene.bearings1[i] = BearingOf(scene.camera, scene.keypoints1[i]);
    scene.bearings2[i] = BearingOf(scene.camera, scene.keypoints2[i]);
  }
  Pose turn;
  turn.rotation = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY());
  const Pose stated = turn * scene.cam2_from_world;
  VerifyPairOptions options;
  EXPECT_EQ(Verify(scene, scene.cam1_from_world, stated, options).config, TwoViewConfig::kDegenerate);
  options.max_ray_angle_deg = 180;
  EXPECT_NE(Verify(scene, scene.cam1_from_world, stated, options).config, TwoViewConfig::kDegenerate);
}

TEST(VerifyPair, WithoutPosesTheFivePointEstimatorFindsTheInliers) {
  const TwoViewScene scene = MakeTwoViewScene({.num_outliers = 60});
  const TwoViewGeometry geometry = VerifyUnposed(scene);
  EXPECT_EQ(geometry.config, TwoViewConfig::kCalibrated);
  EXPECT_GE(NumTrueInliers(geometry, 100), 98);
  EXPECT_LE(geometry.inliers.size(), 100u + 6u);
  EXPECT_EQ(geometry.inliers, VerifyUnposed(scene).inliers);  // fixed seed
  const Eigen::Vector3d singular = geometry.E.jacobiSvd().singularValues();
  EXPECT_NEAR(singular[0], singular[1], 1e-9);
  EXPECT_NEAR(singular[2], 0, 1e-9);
}

TEST(VerifyPair, EightPointsFindTheInliersWithoutReadingPoses) {
  TwoViewScene scene = MakeTwoViewScene({.num_outliers = 60, .noise_px = 0.5});
  const VerifyPairOptions options{.two_view = "eight_point"};
  const TwoViewGeometry geometry = Verify(scene, std::nullopt, std::nullopt, options);
  EXPECT_EQ(geometry.config, TwoViewConfig::kCalibrated);
  EXPECT_GE(NumTrueInliers(geometry, 100), 90);
  EXPECT_LE(geometry.inliers.size(), 100u + 10u);
  const Eigen::Vector3d singular = geometry.E.jacobiSvd().singularValues();
  EXPECT_NEAR(singular[0], singular[1], 1e-9);
  EXPECT_NEAR(singular[2], 0, 1e-9);
  // Stated poses, wrong ones at that, change nothing.
  EXPECT_EQ(Verify(scene, scene.cam2_from_world, scene.cam1_from_world, options).inliers, geometry.inliers);
  scene.camera.has_focal_prior = false;
  const TwoViewGeometry uncalibrated = Verify(scene, std::nullopt, std::nullopt, options);
  EXPECT_EQ(uncalibrated.config, TwoViewConfig::kUncalibrated);
  EXPECT_GE(NumTrueInliers(uncalibrated, 100), 90);
  EXPECT_EQ(uncalibrated.E.norm(), 0);
}

TEST(VerifyPair, GuessedFocalLengthGivesAFundamentalMatrix) {
  TwoViewScene scene = MakeTwoViewScene({.num_outliers = 40});
  scene.camera.has_focal_prior = false;
  const TwoViewGeometry geometry = VerifyUnposed(scene);
  EXPECT_EQ(geometry.config, TwoViewConfig::kUncalibrated);
  EXPECT_GE(NumTrueInliers(geometry, 100), 95);
  EXPECT_EQ(geometry.E.norm(), 0);
  EXPECT_GT(geometry.F.norm(), 0);
}

TEST(VerifyPair, WrongIntrinsicsAreFoundOut) {
  // Pixels taken for oblong: no essential matrix explains what the fundamental matrix does.
  TwoViewScene scene = MakeTwoViewScene({.num_points = 300, .turn_rad = 0.5});
  scene.cam2_from_world.translation = {-1.5, 0.4, 0.5};
  scene.camera.params[0] = 1000;
  scene.camera.params[1] = 250;
  for (int i = 0; i < 300; ++i) {
    scene.bearings1[i] = BearingOf(scene.camera, scene.keypoints1[i]);
    scene.bearings2[i] = BearingOf(scene.camera, scene.keypoints2[i]);
  }
  EXPECT_EQ(VerifyUnposed(scene).config, TwoViewConfig::kUncalibrated);
}

TEST(VerifyPair, FundamentalMatrixActsOnPixels) {
  const TwoViewScene scene = MakeTwoViewScene({.noise_px = 0});
  for (const bool is_posed : {true, false}) {
    const TwoViewGeometry geometry = is_posed ? VerifyPosed(scene) : VerifyUnposed(scene);
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d p1(scene.keypoints1[i].x, scene.keypoints1[i].y, 1);
      const Eigen::Vector3d p2(scene.keypoints2[i].x, scene.keypoints2[i].y, 1);
      EXPECT_NEAR(p2.dot(geometry.F * p1) / (geometry.F * p1).head<2>().norm(), 0, 0.01);
    }
  }
}

TEST(VerifyPair, FlatSceneIsPlanarAndItsHomographyActsOnPixels) {
  const TwoViewScene scene = MakeTwoViewScene({.noise_px = 0.2, .is_flat = true});
  EXPECT_EQ(VerifyPosed(scene).config, TwoViewConfig::kPlanar);
  const TwoViewGeometry geometry = VerifyUnposed(scene);
  EXPECT_EQ(geometry.config, TwoViewConfig::kPlanarOrPanoramic);
  EXPECT_EQ(NumTrueInliers(geometry, 100), 100);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d p1(scene.keypoints1[i].x, scene.keypoints1[i].y, 1);
    const Eigen::Vector2d p2(scene.keypoints2[i].x, scene.keypoints2[i].y);
    EXPECT_LT(((geometry.H * p1).hnormalized() - p2).norm(), 2);
  }
}

TEST(VerifyPair, PureRotationNeedsNoEpipolarLine) {
  const TwoViewScene scene = MakeTwoViewScene({.num_points = 60, .num_outliers = 40, .baseline_m = 0});
  const TwoViewGeometry geometry = VerifyPosed(scene);
  EXPECT_EQ(geometry.config, TwoViewConfig::kPanoramic);
  EXPECT_EQ(NumTrueInliers(geometry, 60), 60);
  EXPECT_LE(geometry.inliers.size(), 62u);
  EXPECT_EQ(geometry.E.norm(), 0);
  EXPECT_EQ(VerifyUnposed(scene).config, TwoViewConfig::kPlanarOrPanoramic);
}

TEST(VerifyPair, RotationWithAWronglyStatedBaselineIsPanoramic) {
  const TwoViewScene scene = MakeTwoViewScene({.baseline_m = 0});
  Pose stated = scene.cam2_from_world;
  stated.translation = {0.01, -0.02, 0.01};
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, stated);
  EXPECT_EQ(geometry.config, TwoViewConfig::kPanoramic);
  EXPECT_GE(NumTrueInliers(geometry, 100), 98);
}

TEST(VerifyPair, RotationStatedWithAnErrorIsRefined) {
  const TwoViewScene scene = MakeTwoViewScene({.baseline_m = 0});
  Pose stated = scene.cam2_from_world;  // 10 px off, more than an inlier may be
  stated.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitY())) * stated.rotation;
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, stated);
  EXPECT_EQ(geometry.config, TwoViewConfig::kPanoramic);
  EXPECT_EQ(NumTrueInliers(geometry, 100), 100);
}

TEST(VerifyPair, IdenticalImagesAreNoBaseline) {
  TwoViewScene scene = MakeTwoViewScene({});
  scene.keypoints2 = scene.keypoints1;
  scene.bearings2 = scene.bearings1;
  EXPECT_EQ(VerifyUnposed(scene).config, TwoViewConfig::kPlanarOrPanoramic);
  EXPECT_EQ(Verify(scene, scene.cam1_from_world, scene.cam1_from_world).config, TwoViewConfig::kPanoramic);
}

TEST(VerifyPair, WatermarkOnTheBordersIsNoPair) {
  // A caption along the lower edge of both images, shifted by three pixels, and little else.
  TwoViewScene scene = MakeTwoViewScene({.num_points = 0, .num_outliers = 60});
  Random random(3);
  for (int i = 0; i < 60; ++i) {
    if (i < 50) {
      scene.keypoints1[i] = {static_cast<float>(10 * i + 50), static_cast<float>(random.Uniform(430, 475)), 1,
                             0};
      scene.keypoints2[i] = {scene.keypoints1[i].x + 3, scene.keypoints1[i].y, 1, 0};
    }
    scene.bearings1[i] = BearingOf(scene.camera, scene.keypoints1[i]);
    scene.bearings2[i] = BearingOf(scene.camera, scene.keypoints2[i]);
  }
  const TwoViewGeometry geometry = VerifyUnposed(scene);
  EXPECT_EQ(geometry.config, TwoViewConfig::kWatermark);
  EXPECT_TRUE(geometry.inliers.empty());
}

TEST(VerifyPair, FisheyeBearingsBeyond90DegreesCount) {
  // A camera in the middle of its points that looks all around, moved by half a metre; a third of the points
  // lies behind it, where no perspective coordinates exist.
  TwoViewScene scene = MakeTwoViewScene({.num_points = 0});
  Random random(5);
  for (uint32_t i = 0; i < 240; ++i) {
    Eigen::Vector3d point(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0.4, 1));
    point *= random.Uniform(2, 5) / point.norm();
    const auto noise = [&] {
      return Eigen::Vector3d(random.Normal(0, 5e-4), random.Normal(0, 5e-4), random.Normal(0, 5e-4));
    };
    scene.bearings1.push_back(((scene.cam1_from_world * point).normalized() + noise()).normalized());
    scene.bearings2.push_back(
        ((Pose{scene.cam2_from_world.rotation, {-0.5, 0.02, 0}} * point).normalized() + noise())
            .normalized());
    scene.keypoints1.push_back({static_cast<float>(random.Uniform(100, 500)), 240, 1, 0});
    scene.keypoints2.push_back({static_cast<float>(random.Uniform(100, 500)), 240, 1, 0});
    scene.matches.push_back({i, i});
  }
  scene.cam2_from_world.translation = {-0.5, 0.02, 0};
  for (const bool is_posed : {true, false}) {
    const TwoViewGeometry geometry = is_posed ? VerifyPosed(scene) : VerifyUnposed(scene);
    EXPECT_EQ(geometry.config, TwoViewConfig::kCalibrated);
    EXPECT_GE(NumTrueInliers(geometry, 240), 235);
  }
}

TEST(VerifyPair, FewerThanEightMatchesAreNoPair) {
  for (const int num : {0, 1, 4, 7}) {
    const TwoViewScene scene = MakeTwoViewScene({.num_points = num});
    EXPECT_TRUE(VerifyPosed(scene).inliers.empty());
    EXPECT_TRUE(VerifyUnposed(scene).inliers.empty());
  }
}

TEST(VerifyPair, FewerInliersThanAskedForAreNoPair) {
  const TwoViewScene scene = MakeTwoViewScene({.num_points = 14});
  EXPECT_TRUE(VerifyPosed(scene).inliers.empty());
  EXPECT_TRUE(VerifyUnposed(scene).inliers.empty());
}

TEST(VerifyPair, KeypointsWithoutBearingAreLeftOut) {
  TwoViewScene scene = MakeTwoViewScene({});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 10; ++i) scene.bearings1[i] = Eigen::Vector3d::Constant(nan);
  scene.bearings2[10] = Eigen::Vector3d(0, nan, 1);
  for (const bool is_posed : {true, false}) {
    const TwoViewGeometry geometry = is_posed ? VerifyPosed(scene) : VerifyUnposed(scene);
    ASSERT_GE(geometry.inliers.size(), 85u);
    EXPECT_GE(geometry.inliers.front().idx1, 11u);
  }
}

TEST(VerifyPair, MatchesOnOneLineOrOnOnePointDoNotCrash) {
  for (const bool is_point : {true, false}) {
    TwoViewScene scene = MakeTwoViewScene({});
    for (int i = 0; i < 100; ++i) {
      const auto x = static_cast<float>(is_point ? 300 : 100 + 3 * i);
      scene.keypoints1[i] = {x, 200, 1, 0};
      scene.keypoints2[i] = {x + 20, 210, 1, 0};
      scene.bearings1[i] = BearingOf(scene.camera, scene.keypoints1[i]);
      scene.bearings2[i] = BearingOf(scene.camera, scene.keypoints2[i]);
    }
    const TwoViewGeometry geometry = VerifyUnposed(scene);
    EXPECT_TRUE(geometry.F.allFinite() && geometry.E.allFinite() && geometry.H.allFinite());
    EXPECT_TRUE(VerifyPosed(scene).F.allFinite());
  }
}

}  // namespace
}  // namespace cairn::match_features
