#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/base/progress.h"
#include "core/camera/camera.h"
#include "core/geometry/pose.h"
#include "stages/reconstruct/globally/free_camera.h"
#include "stages/reconstruct/view_graph/image_motion.h"

namespace cairn::reconstruct {

struct ModelObservation {
  int image = 0, point = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

// What a pair says of its images' rotations: all that ties them where the camera turned on the spot, as
// points without parallax are no points.
struct RelativeRotation {
  int image1 = 0, image2 = 0;
  Eigen::Quaterniond cam2_from_cam1;
  bool is_sure = false;  // no points outvote it
};

// How far apart two images are likely to be, beside a typical step; near 0: the camera turned on the spot.
struct ModelStep {
  int from = 0, to = 0;
  double length = 1;
};

// A reconstruction in a frame of its own, and what was seen.
struct ModelProblem {
  std::vector<Pose> cam_from_world;  // refined
  std::vector<int> camera_idx;       // per image
  std::vector<bool> is_held;         // per image: its pose does not change; empty: of none
  std::vector<FreeCamera> cameras;
  std::vector<Eigen::Vector3d> points;  // refined
  std::vector<ModelObservation> observations;
  std::vector<RelativeRotation> rotations;
  // Images of a drive that follow each other.
  std::vector<ModelStep> steps;
  // What odometry says of others.
  std::vector<ImageMotion> motions;
};

struct AdjustModelOptions {
  // Cauchy's scale of reprojection errors, pixels.  REQUIRES: > 0
  double loss_scale_px = 2;
  // Standard deviations of a pair's rotation, degrees, and of a step's length, in typical ones.  REQUIRES: >
  // 0
  double rotation_sigma_deg = 0.5;
  double step_sigma = 0.5;
  // Standard deviations of a motion, per axis: of its way, as a part of it and of the median one; of its
  // turn, degrees, and as a part of it.  REQUIRES: > 0
  double way_sigma_ratio = 0.05, least_way_sigma_ratio = 0.02;
  double turn_sigma_deg = 0.5, turn_sigma_ratio = 0.05;
  int max_num_iterations = 25;
  // Groups of images that few points join to the others still move where the cost hardly does.
  double function_tolerance = 1e-5;
  // Whether the cameras' free parameters change, too.
  bool adjust_cameras = true;
  // The result does not depend on it.
  int num_threads = 0;
  // Advanced by max_num_iterations, little by little; an adjustment ends when it is cancelled.
  Progress* progress = nullptr;
};

// Minimises the reprojection errors over poses, points and cameras, as group_classes does where poses are
// stated (core/structure/schur_solver.h: bit-stable).  Cameras change by their sensitivities at the
// start (core/structure/camera_sensitivity.h): call it again after larger changes.  The frame is free
// where no image is held.
void AdjustModel(const AdjustModelOptions& options, ModelProblem* problem);

}  // namespace cairn::reconstruct
