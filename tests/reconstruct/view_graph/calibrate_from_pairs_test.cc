#include "stages/reconstruct/view_graph/calibrate_from_pairs.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "core/base/random.h"
#include "core/geometry/relative_pose.h"

namespace cairn::reconstruct {
namespace {

Eigen::Matrix3d CalibrationMatrix(double focal) {
  Eigen::Matrix3d K;
  K << focal, 0, 320, 0, focal, 240, 0, 0, 1;
  return K;
}

// Pairs of cameras of 500 px, whose optical axes do not meet, with their fundamental matrices.
MapperInput MakePairs(int num_pairs, bool has_focal_prior, double noise) {
  Random random(2);
  MapperInput input;
  Camera camera = GuessCamera(1, 640, 480);
  camera.has_focal_prior = has_focal_prior;
  input.cameras.emplace(1, camera);
  for (int p = 0; p < num_pairs; ++p) {
    Pose pose;
    pose.rotation = Eigen::AngleAxisd(
        random.Uniform(0.1, 0.5),
        Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1)).normalized());
    pose.translation = {random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1)};
    const Eigen::Matrix3d inverse = CalibrationMatrix(500).inverse();
    TwoViewGeometry geometry{.image_id1 = static_cast<ImageId>(2 * p + 1),
                             .image_id2 = static_cast<ImageId>(2 * p + 2),
                             .config = TwoViewConfig::kUncalibrated};
    geometry.F = inverse.transpose() * EssentialMatrix(pose) * inverse;
    for (double& value : geometry.F.reshaped()) value *= 1 + random.Normal(0, noise);
    geometry.inliers.resize(100);
    input.images.push_back({geometry.image_id1, "a", 1});
    input.images.push_back({geometry.image_id2, "b", 1});
    input.geometries.push_back(geometry);
  }
  return input;
}

double FocalOf(const MapperInput& input) { return CalibrateFromPairs(input).at(1).params[0]; }

TEST(CalibrateFromPairs, FindsTheFocalLengthThatNobodyStated) {
  EXPECT_NEAR(FocalOf(MakePairs(40, false, 0)), 500, 2);
  EXPECT_NEAR(FocalOf(MakePairs(40, false, 0.005)), 500, 25);
}

TEST(CalibrateFromPairs, AStatedFocalLengthStays) { EXPECT_EQ(FocalOf(MakePairs(40, true, 0)), 1.2 * 640); }

TEST(CalibrateFromPairs, WithoutEvidenceItIsWhatIsLikely) {
  EXPECT_NEAR(FocalOf(MakePairs(0, false, 0)), 0.8 * 640, 10);
  MapperInput planar = MakePairs(40, false, 0);
  for (TwoViewGeometry& geometry : planar.geometries) geometry.config = TwoViewConfig::kPlanarOrPanoramic;
  EXPECT_NEAR(FocalOf(planar), 0.8 * 640, 10);
}

TEST(CalibrateFromPairs, TwoCamerasAreFoundTogether) {
  MapperInput input = MakePairs(60, false, 0);
  Camera other = GuessCamera(2, 640, 480);
  input.cameras.emplace(2, other);
  // The second image of each pair has a camera of 700 px.
  for (size_t g = 0; g < input.geometries.size(); ++g) {
    TwoViewGeometry& geometry = input.geometries[g];
    if (g % 3 == 0) continue;  // within the first camera
    geometry.F =
        CalibrationMatrix(700).inverse().transpose() * CalibrationMatrix(500).transpose() * geometry.F;
    input.images[2 * g + 1].camera_id = 2;
  }
  const auto cameras = CalibrateFromPairs(input);
  EXPECT_NEAR(cameras.at(1).params[0], 500, 10);
  EXPECT_NEAR(cameras.at(2).params[0], 700, 10);
}

}  // namespace
}  // namespace cairn::reconstruct
