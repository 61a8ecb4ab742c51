#include "stages/match_features/verify_pair.h"

#include <set>

#include <gtest/gtest.h>

#include "core/random.h"

namespace cairn {
namespace {

// Two cameras that look at random points in a box, with matches of which the last `num_outliers` are wrong.
struct Scene {
  Camera camera;
  Pose cam1_from_world, cam2_from_world;
  std::vector<Eigen::Vector2d> rays1, rays2;
  std::vector<Match> matches;
};

Scene MakeScene(int num_points, int num_outliers, double noise_px, bool is_flat = false,
                double baseline_m = 0.5) {
  Scene scene;
  scene.camera.model = CameraModel::kPinhole;
  scene.camera.width = 640;
  scene.camera.height = 480;
  scene.camera.params = {500, 500, 320, 240};
  scene.cam2_from_world.rotation = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY());
  scene.cam2_from_world.translation = Eigen::Vector3d(-baseline_m, 0.05 * (baseline_m > 0), 0);
  Random random(7);
  for (int i = 0; i < num_points + num_outliers; ++i) {
    const Eigen::Vector3d point(random.Uniform(-1, 1), random.Uniform(-0.7, 0.7),
                                is_flat ? 3 : random.Uniform(2, 5));
    const auto noise = [&] {
      return Eigen::Vector2d(random.Normal(0, noise_px), random.Normal(0, noise_px));
    };
    const Eigen::Vector2d pixel1 = *ImageFromCamera(scene.camera, scene.cam1_from_world * point) + noise();
    Eigen::Vector2d pixel2 = *ImageFromCamera(scene.camera, scene.cam2_from_world * point) + noise();
    if (i >= num_points) pixel2 = Eigen::Vector2d(random.Uniform(0, 640), random.Uniform(0, 480));
    scene.rays1.push_back(*CameraFromImage(scene.camera, pixel1));
    scene.rays2.push_back(*CameraFromImage(scene.camera, pixel2));
    scene.matches.push_back({static_cast<uint32_t>(i), static_cast<uint32_t>(i)});
  }
  return scene;
}

TwoViewGeometry Verify(const Scene& scene, std::optional<Pose> stated1, std::optional<Pose> stated2) {
  return VerifyPair({&scene.camera, &scene.rays1, stated1}, {&scene.camera, &scene.rays2, stated2},
                    scene.matches, {});
}

int NumTrueInliers(const TwoViewGeometry& geometry, int num_points) {
  int num = 0;
  for (const Match& match : geometry.inliers) num += static_cast<int>(match.idx1) < num_points ? 1 : 0;
  return num;
}

TEST(VerifyPair, KnownPosesKeepTrueMatchesAndDropMostOutliers) {
  const Scene scene = MakeScene(100, 100, 0.5);
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, scene.cam2_from_world);
  EXPECT_EQ(geometry.config, TwoViewConfig::kCalibrated);
  EXPECT_GE(NumTrueInliers(geometry, 100), 98);
  EXPECT_LE(geometry.inliers.size(), 100u + 8u);  // an outlier may lie on its epipolar line by chance
}

TEST(VerifyPair, WrongStatedPoseIsRefinedWithinItsNoise) {
  const Scene scene = MakeScene(200, 50, 0.3);
  Pose wrong = scene.cam2_from_world;
  wrong.translation += Eigen::Vector3d(0.02, -0.03, 0.02);
  wrong.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(0.008, Eigen::Vector3d(0.6, 0.8, 0))) * wrong.rotation;
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, wrong);
  EXPECT_GE(NumTrueInliers(geometry, 200), 195);
  for (int i = 0; i < 200; ++i) {  // E explains the true points better than the stated pose does
    EXPECT_LT(std::sqrt(SquaredSampsonError(geometry.E, scene.rays1[i], scene.rays2[i])) * 500, 2.5);
  }
}

TEST(VerifyPair, AliasedMatchesThatContradictTheStatedPosesAreRefused) {
  // The second camera saw an identical place: its matches fit a pose, but not the stated one.
  const Scene scene = MakeScene(100, 0, 0.3);
  Pose elsewhere = scene.cam2_from_world;
  elsewhere.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX())) * elsewhere.rotation;
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, elsewhere);
  EXPECT_EQ(geometry.config, TwoViewConfig::kDegenerate);
  EXPECT_TRUE(geometry.inliers.empty());
}

TEST(VerifyPair, WithoutPosesTheFivePointEstimatorFindsTheInliers) {
  const Scene scene = MakeScene(100, 60, 0.3);
  const TwoViewGeometry geometry = Verify(scene, std::nullopt, std::nullopt);
  EXPECT_EQ(geometry.config, TwoViewConfig::kCalibrated);
  EXPECT_GE(NumTrueInliers(geometry, 100), 95);
  EXPECT_EQ(geometry.inliers, Verify(scene, std::nullopt, std::nullopt).inliers);  // fixed seed
}

TEST(VerifyPair, FundamentalMatrixActsOnPixels) {
  const Scene scene = MakeScene(100, 0, 0);
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, scene.cam2_from_world);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d p1(500 * scene.rays1[i].x() + 320, 500 * scene.rays1[i].y() + 240, 1);
    const Eigen::Vector3d p2(500 * scene.rays2[i].x() + 320, 500 * scene.rays2[i].y() + 240, 1);
    EXPECT_NEAR(p2.dot(geometry.F * p1) / (geometry.F * p1).head<2>().norm(), 0, 0.01);
  }
}

TEST(VerifyPair, FlatSceneIsCalledPlanar) {
  const Scene scene = MakeScene(100, 0, 0.2, /*is_flat=*/true);
  EXPECT_EQ(Verify(scene, scene.cam1_from_world, scene.cam2_from_world).config,
            TwoViewConfig::kPlanarOrPanoramic);
}

TEST(VerifyPair, PureRotationNeedsNoEpipolarLine) {
  const Scene scene = MakeScene(60, 40, 0.3, false, /*baseline_m=*/0);
  const TwoViewGeometry geometry = Verify(scene, scene.cam1_from_world, scene.cam2_from_world);
  EXPECT_EQ(geometry.config, TwoViewConfig::kPanoramic);
  EXPECT_EQ(NumTrueInliers(geometry, 60), 60);
  EXPECT_LE(geometry.inliers.size(), 62u);
}

TEST(VerifyPair, TooFewMatchesAreNoPair) {
  const Scene scene = MakeScene(10, 0, 0.1);
  EXPECT_TRUE(Verify(scene, scene.cam1_from_world, scene.cam2_from_world).inliers.empty());
  EXPECT_TRUE(Verify(scene, std::nullopt, std::nullopt).inliers.empty());
}

}  // namespace
}  // namespace cairn
