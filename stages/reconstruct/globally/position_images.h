#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace cairn::reconstruct {

// A direction in which an image shows a point, a unit vector in the world's frame.
struct Sight {
  int image = 0, point = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

// Two images of which one follows the other.
struct Step {
  int from = 0, to = 0;
  // From the one's centre to the other's, in the world's frame, metres; none: about as long as others.
  std::optional<Eigen::Vector3d> way;
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
  // Weights beside one sight: of a step's length, and of its measured way, relative to a typical one.
  double step_weight = 0.1, way_weight = 1;
};

// Places of images and points, up to shift and scale, from nowhere: all at random (or, where a step's way is
// known, along these, and points some steps away where they were seen), then
//   min sum_ik rho(|v_ik - d_ik (X_k - c_i)|^2),  d_ik >= 0,
// over centres c, points X and factors d, where v are the sights [Pan, Barath, Pollefeys & Schönberger,
// "Global structure-from-motion revisited", ECCV 2024, §3.3; bilinear as in Zhuang, Cheong & Lee 2018,
// BATA]. The form needs no start, and points tie cameras on a line together, whose pairwise directions are
// parallel. Ceres, one thread; deterministic.  REQUIRES: the sights join all images and points.
// Steps tie parts together between which the camera turned on the spot and no point tells their scale; with
// known ways the scale is theirs.  REQUIRES: `steps` ascend.
Positions PositionImages(int num_images, int num_points, const std::vector<Sight>& sights,
                         const std::vector<Step>& steps, const PositionImagesOptions& options);

}  // namespace cairn::reconstruct
