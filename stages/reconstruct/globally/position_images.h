#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace cairn::reconstruct {

// A direction in which an image shows a point, a unit vector in the world's frame.
struct Sight {
  int image = 0, point = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

struct Positions {
  std::vector<Eigen::Vector3d> centers;  // per image
  std::vector<Eigen::Vector3d> points;
};

struct PositionImagesOptions {
  int max_num_iterations = 100;
  // Length of a residual, of unit vectors, beyond which it counts linearly (Huber).
  double loss_scale = 0.1;
  uint64_t seed = 1;
  // Of a drive: weight of a step's length beside one sight.
  double step_weight = 0.1;
};

// Places of images and points, up to shift and scale, from nowhere: all at random, then
//   min sum_ik rho(|v_ik - d_ik (X_k - c_i)|^2),  d_ik >= 0,
// over centres c, points X and factors d, where v are the sights [Pan, Barath, Pollefeys & Schönberger,
// "Global structure-from-motion revisited", ECCV 2024, §3.3; bilinear as in Zhuang, Cheong & Lee 2018,
// BATA]. The form needs no start, and points tie cameras on a line together, whose pairwise directions are
// parallel. Ceres, one thread; deterministic.  REQUIRES: the sights join all images and points.
// `is_drive`: images follow each other at steps of about one length, which ties parts together between which
// the camera turned on the spot and no point tells their scale.
Positions PositionImages(int num_images, int num_points, const std::vector<Sight>& sights, bool is_drive,
                         const PositionImagesOptions& options);

}  // namespace cairn::reconstruct
