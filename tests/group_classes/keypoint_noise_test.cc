#include "stages/group_classes/adjust/keypoint_noise.h"

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::group_classes {
namespace {

struct Seen {
  BundleProblem problem;
  std::vector<double> scales;
};

// 30 images of 200 points each at their true poses.  Each keypoint errs by `sigma` and by `per_scale` times
// its scale; each image is sheared by up to `shear_px` from top to bottom, as by a rolling shutter.
Seen MakeSeen(double sigma, double per_scale, double shear_px, int num_points = 200) {
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 500, 320, 240};
  Random random(6);
  Seen seen;
  seen.problem.cameras.resize(1);
  for (int i = 0; i < 30; ++i) {
    seen.problem.images.emplace_back();
    const double shear = random.Normal(0, shear_px);
    for (int k = 0; k < num_points; ++k) {
      const Eigen::Vector2d pixel(random.Uniform(0, 640), random.Uniform(0, 480));
      seen.problem.points.push_back(random.Uniform(1, 5) * *BearingFromImage(camera, pixel));
      const double scale = random.Uniform(1, 8);
      const double error = std::hypot(sigma, per_scale * scale);
      BundleProblem::Observation o;
      o.image_idx = i;
      o.point_idx = static_cast<int>(seen.problem.points.size()) - 1;
      o.pixel = pixel + Eigen::Vector2d(random.Normal(0, error) + shear * (pixel.y() / 480 - 0.5),
                                        random.Normal(0, error));
      o.ray = *MakePixelRay(camera, o.pixel);
      seen.problem.observations.push_back(o);
      seen.scales.push_back(scale);
    }
  }
  return seen;
}

KeypointNoise Measure(const Seen& seen) { return MeasureKeypointNoise(seen.problem, seen.scales); }

TEST(MeasureKeypointNoise, GrowsWithTheScaleAsItDoes) {
  const KeypointNoise noise = Measure(MakeSeen(0.5, 0.1, 0));
  EXPECT_NEAR(noise.sigma_px, 0.5, 0.05);
  EXPECT_NEAR(noise.sigma_per_scale, 0.1, 0.01);
  EXPECT_NEAR(noise.SigmaPx(5), std::hypot(0.5, 0.5), 0.05);
  const KeypointNoise constant = Measure(MakeSeen(0.5, 0, 0));
  EXPECT_NEAR(constant.sigma_px, 0.5, 0.03);
  EXPECT_LT(constant.sigma_per_scale, 0.03);
  const KeypointNoise proportional = Measure(MakeSeen(0, 0.2, 0));
  EXPECT_LT(proportional.sigma_px, 0.15);
  EXPECT_NEAR(proportional.sigma_per_scale, 0.2, 0.02);
}

TEST(MeasureKeypointNoise, IndependentErrorsAreNotShared) {
  EXPECT_LT(Measure(MakeSeen(0.5, 0.1, 0)).correlation, 0.002);
  EXPECT_NEAR(Measure(MakeSeen(0.5, 0.1, 0)).Dispersion(200), 1, 0.2);
}

TEST(MeasureKeypointNoise, AShearOfTheImageIsSharedByItsKeypoints) {
  const double little = Measure(MakeSeen(0.5, 0, 1)).correlation,
               much = Measure(MakeSeen(0.5, 0, 3)).correlation;
  EXPECT_GT(little, 0.02);
  EXPECT_GT(much, 3 * little);
  EXPECT_GT(Measure(MakeSeen(0.5, 0, 3)).Dispersion(200), 10);
}

TEST(MeasureKeypointNoise, ASingleWrongMatchInTenIsNoNoise) {
  Seen seen = MakeSeen(0.5, 0, 0);
  for (size_t i = 0; i < seen.problem.observations.size(); i += 10)
    seen.problem.observations[i].ray.pixel_from_plane.col(2) += Eigen::Vector2d(20, 30);
  const KeypointNoise noise = Measure(seen);
  EXPECT_NEAR(noise.sigma_px, 0.5, 0.08);
  EXPECT_LT(noise.correlation, 0.01);
}

TEST(MeasureKeypointNoise, TooLittleToTellIsNoCorrelation) {
  EXPECT_EQ(Measure(MakeSeen(0.5, 0, 3, 30)).correlation, 0);  // halves of fewer than 20 keypoints
  EXPECT_EQ(MeasureKeypointNoise({}, {}).correlation, 0);
  EXPECT_EQ(MeasureKeypointNoise({}, {}).sigma_px, 1);
}

}  // namespace
}  // namespace cairn::group_classes
