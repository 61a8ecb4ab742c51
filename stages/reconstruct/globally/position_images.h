#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "stages/reconstruct/globally/image_ways.h"

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
  // Weight beside one sight of a way that is wrong by a unit.
  double way_weight = 1;
  // Advanced by max_num_iterations, little by little; positioning ends when it is cancelled.
  Progress* progress = nullptr;
};

// Places of images and points, from those of images: points are put some units away from the images that see
// them, then
//   min sum_ik rho(|v_ik - d_ik (X_k - c_i)|^2),  d_ik >= 0,
// over centres c, points X and factors d, where v are the sights [Pan, Barath, Pollefeys & Schönberger,
// "Global structure-from-motion revisited", ECCV 2024, §3.3; bilinear as in Zhuang, Cheong & Lee 2018,
// BATA].  Points tie cameras on a line together, whose pairwise directions are parallel; `ways` tie parts
// together between which the camera turned on the spot and no point tells their scale.  Ceres, one thread;
// deterministic.  REQUIRES: `unit` > 0
Positions PositionImages(const std::vector<Eigen::Vector3d>& start, int num_points,
                         const std::vector<Sight>& sights, const std::vector<Way>& ways, double unit,
                         const PositionImagesOptions& options);

}  // namespace cairn::reconstruct
