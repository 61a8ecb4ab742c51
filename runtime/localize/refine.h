#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "core/base/pooled.h"
#include "core/geometry/pose.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"

namespace cairn {

// exp of a perturbation xi = (rotation in rad, translation in m), applied from the left:
// cam_from_world' = (Exp(rotation), translation) * cam_from_world.
Pose Perturb(const Pose& cam_from_world, const Vector6d& xi);
// The xi with Perturb(from, xi) = to.
Vector6d PerturbationBetween(const Pose& from, const Pose& to);

// Minimises the robust sum over measurements of rho(r' S^-1 r): r = reprojection error in px, S = keypoint's
// variance + landmark's covariance projected into the image, rho = Cauchy's loss; plus the square of up's
// error where up is known.  Levenberg-Marquardt on 6 parameters.  Nothing when fewer than 3 points lie in
// front of their camera or the normal equations are singular.
std::optional<Pose> RefinePose(std::span<const PoseMeasurement> measurements, const Pose& initial,
                               const RefineOptions& options,
                               const std::optional<UpMeasurement>& up = std::nullopt,
                               WorkBudget* work = nullptr);

// How far up is, where a pose has it, from where it was sensed, standard deviations.
double UpErrorInSigmas(const UpMeasurement& up, const Pose& rig_from_world);

// A pose with its uncertainty.
struct RefinedPose {
  Pose cam_from_world;
  // Order: rotation (rad), translation (m); of the left perturbation.  Inverse of the normal matrix, scaled
  // by the noise that the inliers show (unbiased for the normalised error squared: the residuals' sum is
  // divided by their degrees of freedom minus 2, as the mean of an F distribution requires), and corrected
  // for the outliers left out.
  Matrix6d covariance = Matrix6d::Identity();
  double noise_variance = 1;  // of whitened residuals; 1: keypoints and landmarks are as accurate as stated
  PooledVector<int> inliers;  // indices of measurements, ascending
};

// Refines robustly, then by least squares over the inliers, whose limit follows the noise found.
// Nothing when fewer than 5 inliers are left or the geometry is degenerate.
std::optional<RefinedPose> RefinePoseWithCovariance(std::span<const PoseMeasurement> measurements,
                                                    const Pose& initial, const RefineOptions& options,
                                                    const std::optional<UpMeasurement>& up = std::nullopt,
                                                    WorkBudget* work = nullptr);

// Of a covariance's worst direction; infinite where it is not a number.
double LargestSigma(const Eigen::Matrix3d& covariance);

// Covariance of b_from_world for b_from_cam * cam_from_world: Ad C Ad'.
Matrix6d TransformCovariance(const Pose& b_from_cam, const Matrix6d& covariance);

}  // namespace cairn
