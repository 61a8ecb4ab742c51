#pragma once

#include <utility>
#include <vector>

#include "core/base/random.h"
#include "stages/group_classes/adjust/bundle.h"
#include "tests/core/structure/lens.h"

namespace cairn::group_classes {

// 12 cameras in a circle that look at points in its middle.
struct Circle {
  std::vector<Pose> poses;
  std::vector<Eigen::Vector3d> points;
  BundleProblem problem;
};

inline Circle MakeCircle(const Camera& seen_by, const Camera& stated, double noise_px,
                         std::vector<int> free) {
  Circle circle;
  Random random(4);
  for (int j = 0; j < 150; ++j)
    circle.points.emplace_back(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
  BundleProblem& problem = circle.problem;
  problem.points = circle.points;
  problem.is_offset_free = false;
  problem.noise = {1e-5, 1e-4, 1e-5, 1e-4};
  for (int i = 0; i < 12; ++i) {
    Pose pose;
    pose.rotation = Eigen::AngleAxisd(-0.5 * i, Eigen::Vector3d::UnitY());
    pose.translation = {0, 0, 2.2 + 0.5 * (i % 3)};  // distances differ: they tell the focal length
    circle.poses.push_back(pose);
    BundleProblem::Image image;
    image.stated = image.cam_from_world = image.drifted = pose;
    image.way_m = 1.5;
    problem.images.push_back(image);
  }
  CameraBlock block;
  block.free = free;
  block.prior.assign(free.size(), 0);
  block.delta.assign(free.size(), 0);
  for (const int p : free) block.sigma.push_back(p < 4 ? 50 : 0.5);
  problem.cameras = {block};
  for (int j = 0; j < 150; ++j) {
    for (int i = 0; i < 12; ++i) {
      const auto pixel = ImageFromCamera(seen_by, circle.poses[i] * circle.points[j]);
      if (!pixel) continue;
      BundleProblem::Observation o;
      o.image_idx = i;
      o.point_idx = j;
      o.pixel = *pixel + Eigen::Vector2d(random.Normal(0, noise_px), random.Normal(0, noise_px));
      const auto ray = MakePixelRay(stated, o.pixel);
      if (!ray) continue;
      o.ray = *ray;
      o.camera = SensitivityOf(stated, o.pixel, free);
      o.sigma_px = noise_px;
      problem.observations.push_back(o);
    }
  }
  return circle;
}

}  // namespace cairn::group_classes
