#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/base/pooled.h"
#include "core/base/random.h"
#include "stages/match_features/two_views/verify_pair.h"

namespace cairn::match_features {

// Two cameras that see the same points, with one match per point: first the true ones, then outliers whose
// second keypoint lies anywhere.  Descriptors are random unless a test makes them alike.
struct TwoViewScene {
  Camera camera;
  Pose cam1_from_world, cam2_from_world;
  PooledVector<Keypoint> keypoints1, keypoints2;
  std::vector<Eigen::Vector3d> bearings1, bearings2;
  DescriptorMatrix descriptors1, descriptors2;
  std::vector<Match> matches;

  ViewForVerification View1(const std::optional<Pose>& stated) const {
    return {&camera, &keypoints1, &bearings1, nullptr, {}, stated};
  }
  ViewForVerification View2(const std::optional<Pose>& stated) const {
    return {&camera, &keypoints2, &bearings2, nullptr, {}, stated};
  }
};

struct TwoViewSceneOptions {
  int num_points = 100;
  int num_outliers = 0;
  double noise_px = 0.3;
  bool is_flat = false;
  double baseline_m = 0.5;
  double turn_rad = 0.1;
  uint64_t seed = 7;
};

inline Camera SceneCamera() {
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 500, 320, 240};
  return camera;
}

inline Eigen::Vector3d BearingOf(const Camera& camera, const Keypoint& keypoint) {
  return CameraFromImage(camera, {keypoint.x, keypoint.y})->homogeneous().normalized();
}

inline TwoViewScene MakeTwoViewScene(const TwoViewSceneOptions& options) {
  TwoViewScene scene;
  scene.camera = SceneCamera();
  scene.cam2_from_world.rotation = Eigen::AngleAxisd(options.turn_rad, Eigen::Vector3d::UnitY());
  scene.cam2_from_world.translation =
      Eigen::Vector3d(-options.baseline_m, 0.05 * (options.baseline_m > 0), 0);
  Random random(options.seed);
  const auto keypoint = [&](const Pose& cam_from_world, const Eigen::Vector3d& point) {
    const Eigen::Vector2d pixel = *ImageFromCamera(scene.camera, cam_from_world * point);
    return Keypoint{static_cast<float>(pixel.x() + random.Normal(0, options.noise_px)),
                    static_cast<float>(pixel.y() + random.Normal(0, options.noise_px)), 1, 0};
  };
  for (int i = 0; i < options.num_points + options.num_outliers; ++i) {
    const double depth = options.is_flat ? 3 : random.Uniform(2, 5);
    const Eigen::Vector3d point(random.Uniform(-1, 1), random.Uniform(-0.7, 0.7), depth);
    scene.keypoints1.push_back(keypoint(scene.cam1_from_world, point));
    scene.keypoints2.push_back(keypoint(scene.cam2_from_world, point));
    if (i >= options.num_points) {
      scene.keypoints2.back() = {static_cast<float>(random.Uniform(0, 640)),
                                 static_cast<float>(random.Uniform(0, 480)), 1, 0};
    }
    scene.bearings1.push_back(BearingOf(scene.camera, scene.keypoints1.back()));
    scene.bearings2.push_back(BearingOf(scene.camera, scene.keypoints2.back()));
    scene.matches.push_back({static_cast<uint32_t>(i), static_cast<uint32_t>(i)});
  }
  return scene;
}

// A descriptor of norm near 512, as RootSIFT's are, that no other seed comes near.
inline void FillDescriptor(uint64_t seed, DescriptorMatrix* descriptors, int row) {
  Random random(MixSeed(99, seed));
  Eigen::Matrix<double, 1, kSiftDescriptorDim> values;
  for (int d = 0; d < kSiftDescriptorDim; ++d)
    values[d] = std::abs(random.Normal(0, 1)) * (random.Uniform() < 0.3);
  values *= 500 / values.norm();
  for (int d = 0; d < kSiftDescriptorDim; ++d)
    (*descriptors)(row, d) = static_cast<uint8_t>(std::min(255.0, values[d]));
}

inline int NumTrueInliers(const TwoViewGeometry& geometry, int num_points) {
  int num = 0;
  for (const Match& match : geometry.inliers)
    num += static_cast<int>(match.idx1) < num_points && match.idx1 == match.idx2 ? 1 : 0;
  return num;
}

}  // namespace cairn::match_features
