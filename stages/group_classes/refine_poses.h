#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/camera/pixel_ray.h"
#include "core/geometry/pose.h"

namespace cairn::group_classes {

struct RefinePosesOptions {
  // Standard deviation of the stated survey poses, metres and degrees: how far the images may move them.
  // REQUIRES: > 0
  double pose_sigma_m = 0.01;
  double pose_sigma_deg = 0.25;
  // Standard deviation of a keypoint's position, pixels.  REQUIRES: > 0
  double keypoint_sigma_px = 1.0;
  // Refine one rigid offset between all stated poses and their cameras (the poses may be a depth camera's or
  // a body's).
  bool refine_camera_offset = true;
  // Standard deviations of that offset about zero, metres and degrees.  REQUIRES: > 0
  double offset_sigma_m = 0.05;
  double offset_sigma_deg = 3.0;
  // Refine one factor on the focal length of each pinhole camera, and its standard deviation about 1.
  // REQUIRES: > 0
  bool refine_focal = false;
  double focal_sigma_ratio = 0.03;
  // Most iterations of the solver.  REQUIRES: >= 1
  int max_num_iterations = 30;
};

// Bundle adjustment problem with contiguous indices; refined in place.
struct PoseProblem {
  struct Observation {
    int image_idx = 0;
    int point_idx = 0;
    PixelRay ray;  // by the unrefined focal length
  };
  std::vector<Pose> stated_poses;      // cam_from_world, from the capture
  std::vector<int> camera_idx;         // per image
  std::vector<bool> is_focal_refined;  // per camera: false for models with distortion
  std::vector<Observation> observations;
  // Refined:
  std::vector<Pose> poses;  // cam_from_world
  std::vector<Eigen::Vector3d> points;
  std::vector<double> focal_ratios;  // per camera, refined over unrefined
  Pose camera_from_given;
};

struct RefinePosesSummary {
  double initial_rms_px = 0;
  double final_rms_px = 0;
  int num_iterations = 0;
  bool converged = false;
};

// Minimises over poses T_i, points X_j, offset O and focal ratios s_c
//   sum_ij rho( |residual_ij(diag(s, s, 1) T_i X_j)|^2 / sigma_px^2 )
//   + sum_i |log(T_i (O G_i)^-1)|^2 weighted by the pose sigmas
//   + |log O|^2 weighted by the offset sigmas + ((s - 1) / sigma_s)^2
// with reprojection residuals (core/camera/pixel_ray.h), Cauchy's loss rho, and stated poses G_i, trusted as
// far as their sigmas say.
// One thread: bit-stable.  Ceres with a sparse Schur complement (Eigen's Cholesky).
RefinePosesSummary RefinePoses(const RefinePosesOptions& options, PoseProblem* problem);

}  // namespace cairn::group_classes
