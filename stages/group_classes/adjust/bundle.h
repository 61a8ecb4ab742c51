#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/camera/camera.h"
#include "core/camera/pixel_ray.h"
#include "core/geometry/pose.h"
#include "core/structure/camera_sensitivity.h"

namespace cairn::group_classes {

class SolvedFile;

// Standard deviations of a survey's stated poses, per axis of the camera.  Each pose has an error of its own;
// and what a tracker drifts from one image to the next adds up: a random walk.
struct PoseNoise {
  double own_m = 0.01, own_deg = 0.25;
  double walk_m = 0.02, walk_deg = 0.5;  // per square root of a metre of way
};

// The parameters of a camera (core/camera/camera.h) that an adjustment changes.
struct CameraBlock {
  std::vector<int> free;      // indices into its parameters, ascending
  std::vector<double> prior;  // per free one: what the change is expected to be ...
  std::vector<double> sigma;  // ... and its standard deviation
  std::vector<double> delta;  // per free one: change since the rays were made; refined
  // Where the first two free ones are fx and fy: what delta[0] - delta[1] is expected to be, and its standard
  // deviation; 0: nothing is known of it.
  double difference_prior = 0, difference_sigma = 0;
};

// Bundle adjustment with contiguous indices; refined in place.
struct BundleProblem {
  struct Image {
    int camera_idx = 0;
    Pose stated;            // cam_from_world, from the capture
    double way_m = 0;       // from the image before, metres; the first has none before it
    double dispersion = 1;  // its keypoints say as much as this many times fewer (keypoint_noise.h)
    Pose cam_from_world;    // refined
    Pose drifted;           // refined: the stated pose, freed from drift
    bool is_fixed = false;  // both stay as they are
  };
  struct Observation {
    int image_idx = 0;
    int point_idx = 0;
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
    PixelRay ray;              // by the camera before its change
    CameraSensitivity camera;  // by the free parameters of its camera; none where none is free
    double sigma_px = 1;
  };
  std::vector<Image> images;
  std::vector<Observation> observations;
  std::vector<Eigen::Vector3d> points;  // refined
  std::vector<CameraBlock> cameras;
  Pose camera_from_given;  // refined where it is free
  bool is_offset_free = true;
  double offset_sigma_m = 0.05, offset_sigma_deg = 3;
  PoseNoise noise;
};

// Of one component of the poses' noise.
struct NoiseEvidence {
  double sum_of_squares = 0;  // of its residuals, in units of their standard deviation
  double num_residuals = 0;
  double num_determined = 0;  // as many of them are determined by keypoints, the rest by the component itself
};

// What an adjustment says of its own priors.
struct BundleEvidence {
  NoiseEvidence own_m, own_deg, walk_m, walk_deg;
  // Squared length of the offset in units of its covariance, 6 degrees of freedom; 0 where it is not free.
  double offset_chi_square = 0;
  std::vector<std::vector<double>> camera_sigma;  // per camera and free parameter
};

struct BundleOptions {
  // Scale of Cauchy's loss, in standard deviations of a keypoint.
  double loss_scale = 2;
  // Most iterations of the solver.  REQUIRES: >= 1
  int max_num_iterations = 30;
  // It has converged when a step lowers the cost by less than this part.  REQUIRES: > 0
  double function_tolerance = 1e-4;
  // How far the first step is trusted (Levenberg-Marquardt): the less, the more it is damped.  REQUIRES: > 0
  double initial_trust_region_radius = 1e4;
  // Each point is placed anew by the poses of a step before the step is judged: otherwise a few points that
  // are weakly determined make it fail for all.
  bool points_follow = false;
  // A long solution is made in pieces of so many steps, each with the trust that the one before ended with;
  // those that are kept in a file need not be made again.  0: in one piece.  REQUIRES: >= 0
  int num_steps_at_once = 0;
  // Where solutions are kept, and taken from; null: nowhere.
  SolvedFile* solved = nullptr;
  // Stops between two steps when it is cancelled, with no meaning; null: never.
  const Progress* cancel = nullptr;
  // Advanced by 1 for each step, and by those that were not needed; null: nothing is.
  Progress* steps = nullptr;
  // The result does not depend on it.
  int num_threads = 1;
};

// Reprojection error of an observation, px.
Eigen::Vector2d ResidualOf(const BundleProblem& problem, const BundleProblem::Observation& observation);

// Minimises over poses T_i, drifted poses D_i, points X_j, the offset O and changes c of the cameras
//   sum_ij rho(|r_ij(T_i X_j, c)|^2 / sigma_ij^2) / dispersion_i     keypoints, Cauchy's loss
//   + sum_i |T_i (O D_i)^-1|^2 / own^2                                     a pose's own error
//   + sum_i |D_i D_i-1^-1 (G_i G_i-1^-1)^-1|^2 / (walk^2 way_i)            drift of the stated poses G_i
//   + |O|^2 / offset^2 + |c - prior|^2 / sigma^2
// with reprojection residuals r (core/camera/pixel_ray.h), which a camera changes as CameraSensitivity says.
// T and D of some images may be fixed, what depends on these alone is left out; where none are, D of the
// first image is.  REQUIRES: no free offset with fixed images  Analytic derivatives, points eliminated
// (core/structure/schur_solver.h). Returns whether it converged.  `evidence` may be null.
bool AdjustBundle(const BundleOptions& options, BundleProblem* problem, BundleEvidence* evidence);

}  // namespace cairn::group_classes
