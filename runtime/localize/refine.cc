#include "runtime/localize/refine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/geometry/vector_geometry.h"
#include "core/work/work_budget.h"

namespace cairn {
namespace {

// Least depth of a point in front of the camera, metres.
constexpr double kMinDepthM = 1e-3;

Eigen::Quaterniond Exp(const Eigen::Vector3d& rotation) {
  const double angle = rotation.norm();
  if (angle < 1e-12)
    return Eigen::Quaterniond(1, 0.5 * rotation.x(), 0.5 * rotation.y(), 0.5 * rotation.z()).normalized();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, rotation / angle));
}

// One measurement linearised at a pose: residual in px, its Jacobian over the perturbation, its covariance.
struct Linearised {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 6> jacobian;
  Eigen::Matrix2d covariance;
};

std::optional<Eigen::Vector2d> Residual(const PoseMeasurement& measurement, const Pose& pose) {
  const Eigen::Vector3d x = measurement.InCamera(pose * measurement.point);
  if (!(x.z() > kMinDepthM)) return std::nullopt;
  return measurement.ray.pixel_from_ray * (x.hnormalized() - measurement.ray.ray);
}

std::optional<Linearised> Linearise(const PoseMeasurement& measurement, const Pose& pose) {
  const Eigen::Vector3d in_rig = pose * measurement.point;
  const Eigen::Vector3d x = measurement.InCamera(in_rig);
  if (!(x.z() > kMinDepthM)) return std::nullopt;
  Eigen::Matrix<double, 2, 3>
      pixel_from_point;  // d residual / d point, in the camera's frame, then the rig's
  const double inverse_z = 1 / x.z();
  pixel_from_point << inverse_z, 0, -x.x() * inverse_z * inverse_z, 0, inverse_z,
      -x.y() * inverse_z * inverse_z;
  pixel_from_point = measurement.ray.pixel_from_ray * pixel_from_point;
  if (measurement.cam_from_rig) pixel_from_point *= measurement.cam_from_rig->rotation.toRotationMatrix();
  Linearised linearised;
  linearised.residual = measurement.ray.pixel_from_ray * (x.hnormalized() - measurement.ray.ray);
  linearised.jacobian.leftCols<3>() = -pixel_from_point * CrossMatrix(in_rig);
  linearised.jacobian.rightCols<3>() = pixel_from_point;
  const Eigen::Matrix<double, 2, 3> pixel_from_landmark = pixel_from_point * pose.rotation.toRotationMatrix();
  linearised.covariance =
      measurement.ray.sigma_px * measurement.ray.sigma_px * Eigen::Matrix2d::Identity() +
      pixel_from_landmark * measurement.point_covariance * pixel_from_landmark.transpose();
  return linearised;
}

struct NormalEquations {
  Matrix6d matrix = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  double cost = 0;
  int num_points = 0;
  PooledVector<Eigen::Matrix2d> informations;  // per measurement; zero behind the camera
  // Of images that are read row by row: how an error of the motion while that goes on moves the gradient, and
  // its standard deviations.
  Matrix6d of_readout = Matrix6d::Zero();
  Vector6d readout_sigmas = Vector6d::Zero();
};

double Cauchy(double squared, double scale) {
  return std::isinf(scale) ? squared : scale * scale * std::log1p(squared / (scale * scale));
}

// Up's error at a pose: the angle between where it is and where it was sensed, rad, as two angles about axes
// at right angles to the latter, and their Jacobian over the perturbation's rotation.
struct UpError {
  Eigen::Vector2d angles;
  Eigen::Matrix<double, 2, 3> jacobian;
};

UpError LineariseUp(const UpMeasurement& up, const Pose& pose) {
  const Eigen::Vector3d at_pose = pose.rotation * up.in_world;
  const Eigen::Matrix<double, 2, 3> basis = TangentBasis(up.in_rig).transpose();
  const Eigen::Vector2d sines = basis * at_pose;
  const double sine = sines.norm();
  const double angle = std::atan2(sine, up.in_rig.dot(at_pose));
  return {sine > 1e-12 ? Eigen::Vector2d(sines * (angle / sine)) : sines, -basis * CrossMatrix(at_pose)};
}

// Up, with its variance in units of the keypoints' noise, which is known only in the course of refinement.
struct WeightedUp {
  std::optional<UpMeasurement> up;
  double variance_unit = 1;

  double Information() const { return variance_unit / (up->sigma_rad * up->sigma_rad); }
  double Cost(const Pose& pose) const {
    return up ? Information() * LineariseUp(*up, pose).angles.squaredNorm() : 0;
  }
};

// `scale`: of the robust loss; infinity for plain least squares.
NormalEquations BuildNormalEquations(std::span<const PoseMeasurement> measurements, const Pose& pose,
                                     double scale, const WeightedUp& up,
                                     PooledVector<Eigen::Matrix2d> memory = {}) {
  NormalEquations equations;
  equations.informations = std::move(memory);
  if (up.up) {
    const UpError error = LineariseUp(*up.up, pose);
    equations.matrix.topLeftCorner<3, 3>() = up.Information() * error.jacobian.transpose() * error.jacobian;
    equations.gradient.head<3>() = up.Information() * error.jacobian.transpose() * error.angles;
    equations.cost = up.Information() * error.angles.squaredNorm();
  }
  equations.informations.assign(measurements.size(), Eigen::Matrix2d::Zero());
  for (size_t i = 0; i < measurements.size(); ++i) {
    const auto linearised = Linearise(measurements[i], pose);
    if (!linearised) continue;
    const Eigen::Matrix2d information = linearised->covariance.inverse();
    const double squared = linearised->residual.dot(information * linearised->residual);
    const double weight = std::isinf(scale) ? 1 : 1 / (1 + squared / (scale * scale));
    const Eigen::Matrix<double, 6, 2> weighted = weight * linearised->jacobian.transpose() * information;
    equations.matrix += weighted * linearised->jacobian;
    equations.gradient += weighted * linearised->residual;
    equations.cost += Cauchy(squared, scale);
    equations.informations[i] = information;
    ++equations.num_points;
    if (const auto& row = measurements[i].row) {
      equations.of_readout += row->part * weighted * linearised->jacobian;
      equations.readout_sigmas = row->motion_sigmas;
    }
  }
  return equations;
}

// The cost at another pose with the same weights of the measurements; infinite when a point went behind
// the camera.
double CostAt(std::span<const PoseMeasurement> measurements, const NormalEquations& equations,
              const Pose& pose, double scale, const WeightedUp& up) {
  double cost = up.Cost(pose);
  for (size_t i = 0; i < measurements.size(); ++i) {
    if (equations.informations[i].isZero(0)) continue;
    const auto residual = Residual(measurements[i], pose);
    if (!residual) return std::numeric_limits<double>::infinity();
    cost += Cauchy(residual->dot(equations.informations[i] * *residual), scale);
  }
  return cost;
}

std::optional<Pose> LevenbergMarquardt(std::span<const PoseMeasurement> measurements, Pose pose, double scale,
                                       int max_num_iterations, const WeightedUp& up, WorkBudget* work) {
  double damping = 1e-6;
  NormalEquations equations;
  for (int iteration = 0; iteration < max_num_iterations && Spend(work, Work::kRefine, measurements.size());
       ++iteration) {
    equations = BuildNormalEquations(measurements, pose, scale, up, std::move(equations.informations));
    if (equations.num_points < 3) return std::nullopt;
    bool improved = false;
    double step_norm = 0;
    for (int attempt = 0; attempt < 8 && !improved; ++attempt) {
      Matrix6d damped = equations.matrix;
      damped.diagonal() *= 1 + damping;
      const Eigen::LDLT<Matrix6d> factors(damped);
      const Vector6d step = -factors.solve(equations.gradient);
      if (factors.info() != Eigen::Success || !factors.isPositive() || !step.allFinite()) return std::nullopt;
      const Pose candidate = Perturb(pose, step);
      if (CostAt(measurements, equations, candidate, scale, up) <= equations.cost) {
        pose = candidate;
        step_norm = step.norm();
        damping = std::max(1e-9, damping * 0.1);
        improved = true;
      } else {
        damping = std::max(1e-4, damping) * 10;
      }
    }
    if (!improved || step_norm < 1e-9) break;
  }
  return pose;
}

// Squared whitened residuals; infinite behind the camera.
PooledVector<double> WhitenedSquares(std::span<const PoseMeasurement> measurements, const Pose& pose) {
  PooledVector<double> squares;
  squares.reserve(measurements.size());
  for (const PoseMeasurement& measurement : measurements) {
    const auto linearised = Linearise(measurement, pose);
    squares.push_back(linearised
                          ? linearised->residual.dot(linearised->covariance.inverse() * linearised->residual)
                          : std::numeric_limits<double>::infinity());
  }
  return squares;
}

// Noise variance from the median of squared residuals, most of which belong to inliers, corrected for the 6
// fitted parameters.
double VarianceFromMedian(const PooledVector<double>& squares) {
  constexpr double kMedianChiSquare = 1.3863;  // of 2 degrees of freedom: 2 ln 2
  const double num_residuals = 2.0 * static_cast<double>(squares.size());
  return std::max(1e-6,
                  UpperMedian(squares) / kMedianChiSquare * num_residuals / std::max(1.0, num_residuals - 6));
}

// Sum of squared residuals of n two-dimensional inliers, as a variance whose inverse has the right mean for
// the normalised error squared: E[F(6, d)] = d / (d - 2).
double VarianceFromSum(double sum, int num_inliers) { return sum / std::max(1, 2 * num_inliers - 6 - 2); }

// 2 / E[r^2 | r^2 < limit] for a chi-square of 2 degrees of freedom: the part of the variance that cutting
// the tail hides.  By Stein's identity the estimate from the inliers alone is worse by the same factor.
double TruncationFactor(double limit) {
  const double tail = std::exp(-0.5 * limit);
  return (1 - tail) / (1 - (1 + 0.5 * limit) * tail);
}

// With how many others of its image a measurement's keypoint errs together, on the mean.  REQUIRES: any
double MeanNumInImage(std::span<const PoseMeasurement> measurements) {
  PooledVector<double> num_in_image;
  double sum = 0;
  for (const PoseMeasurement& measurement : measurements) {
    if (measurement.image >= std::ssize(num_in_image)) num_in_image.resize(measurement.image + 1);
    ++num_in_image[measurement.image];
  }
  for (const double num : num_in_image) sum += num * num;
  return sum / static_cast<double>(measurements.size());
}

Matrix6d Adjoint(const Pose& b_from_a) {
  const Eigen::Matrix3d rotation = b_from_a.rotation.toRotationMatrix();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = rotation;
  adjoint.bottomLeftCorner<3, 3>() = CrossMatrix(b_from_a.translation) * rotation;
  adjoint.bottomRightCorner<3, 3>() = rotation;
  return adjoint;
}

// Adds independent errors of the camera's rotation and place.  The place moves by R' v for a translation v of
// the perturbation, and a rotation about the camera's own centre is the perturbation (w, 0).
void AddSystematic(const RefineOptions& options, Matrix6d* covariance) {
  const double rotation = RadFromDeg(options.systematic_sigma_deg);
  covariance->diagonal().head<3>().array() += rotation * rotation;
  covariance->diagonal().tail<3>().array() += options.systematic_sigma_m * options.systematic_sigma_m;
}

}  // namespace

OptionTable DescribeOptions(RefineOptions* o) {
  return {
      {.name = "robust_scale",
       .value = &o->robust_scale,
       .help = "whitened residual from which a measurement loses weight",
       .min = 1e-3},
      {.name = "max_num_refine_iterations",
       .value = &o->max_num_refine_iterations,
       .help = "most Levenberg-Marquardt steps",
       .min = 1},
      {.name = "inlier_chi_square",
       .value = &o->inlier_chi_square,
       .help = "squared whitened residual up to which a measurement is an inlier",
       .min = 1e-3},
      {.name = "covariance_scale",
       .value = &o->covariance_scale,
       .help = "factor on the reported covariance",
       .min = 1e-9},
      {.name = "keypoint_correlation",
       .value = &o->keypoint_correlation,
       .help = "part of its variance that a keypoint shares with the others of its image; 0: what the map's "
               "survey showed",
       .min = 0,
       .max = 1},
      {.name = "systematic_sigma_m",
       .value = &o->systematic_sigma_m,
       .help = "error of the camera's place that landmarks do not average out, m per axis",
       .min = 0},
      {.name = "systematic_sigma_deg",
       .value = &o->systematic_sigma_deg,
       .help = "error of the camera's rotation that landmarks do not average out, degrees per axis",
       .min = 0},
  };
}

Pose Perturb(const Pose& cam_from_world, const Vector6d& xi) {
  return Pose{Exp(xi.head<3>()), xi.tail<3>()} * cam_from_world;
}

Vector6d PerturbationBetween(const Pose& from, const Pose& to) {
  const Pose difference = to * from.Inverse();
  const Eigen::AngleAxisd rotation(difference.rotation);
  Vector6d xi;
  xi << rotation.angle() * rotation.axis(), difference.translation;
  return xi;
}

std::optional<Pose> RefinePose(std::span<const PoseMeasurement> measurements, const Pose& initial,
                               const RefineOptions& options, const std::optional<UpMeasurement>& up,
                               WorkBudget* work) {
  return LevenbergMarquardt(measurements, initial, options.robust_scale, options.max_num_refine_iterations,
                            {up}, work);
}

double UpErrorInSigmas(const UpMeasurement& up, const Pose& rig_from_world) {
  return LineariseUp(up, rig_from_world).angles.norm() / up.sigma_rad;
}

std::optional<RefinedPose> RefinePoseWithCovariance(std::span<const PoseMeasurement> measurements,
                                                    const Pose& initial, const RefineOptions& options,
                                                    const std::optional<UpMeasurement>& up,
                                                    WorkBudget* work) {
  constexpr int kMinNumInliers = 5;  // 10 residuals for 6 parameters
  if (static_cast<int>(measurements.size()) < kMinNumInliers) return std::nullopt;
  std::optional<Pose> pose = RefinePose(measurements, initial, options, up, work);
  if (!pose) return std::nullopt;
  RefinedPose refined;
  const double truncation = TruncationFactor(options.inlier_chi_square);
  // By how much keypoints' errors are larger than stated, those that they share among them.
  const auto variance_unit = [&](std::span<const PoseMeasurement> used) {
    const double dispersion = 1 + 0.5 * MeanNumInImage(used) * options.keypoint_correlation;
    return options.covariance_scale * dispersion * truncation * refined.noise_variance;
  };
  PooledVector<double> squares = WhitenedSquares(measurements, *pose);
  // The loss's scale is in units of the noise, which is known only now.
  refined.noise_variance = VarianceFromMedian(squares);
  pose = LevenbergMarquardt(measurements, *pose, options.robust_scale * std::sqrt(refined.noise_variance),
                            options.max_num_refine_iterations, {up, variance_unit(measurements)}, work);
  if (!pose) return std::nullopt;
  squares = WhitenedSquares(measurements, *pose);
  refined.noise_variance = VarianceFromMedian(squares);
  for (int round = 0; round < 4; ++round) {
    PooledVector<int> inliers;
    inliers.reserve(squares.size());
    for (size_t i = 0; i < squares.size(); ++i) {
      if (squares[i] <= options.inlier_chi_square * refined.noise_variance)
        inliers.push_back(static_cast<int>(i));
    }
    if (inliers.size() < kMinNumInliers) return std::nullopt;
    if (round > 0 && inliers == refined.inliers) break;
    refined.inliers = std::move(inliers);
    const PooledVector<PoseMeasurement> used = SelectMeasurements(measurements, refined.inliers);
    pose = LevenbergMarquardt(used, *pose, std::numeric_limits<double>::infinity(),
                              options.max_num_refine_iterations, {up, variance_unit(used)}, work);
    if (!pose) return std::nullopt;
    squares = WhitenedSquares(measurements, *pose);
    double sum = 0;
    for (const int i : refined.inliers) sum += squares[i];
    refined.noise_variance =
        std::max(1e-6, truncation * VarianceFromSum(sum, static_cast<int>(refined.inliers.size())));
    if (!std::isfinite(refined.noise_variance)) return std::nullopt;
  }
  const PooledVector<PoseMeasurement> used = SelectMeasurements(measurements, refined.inliers);
  const double unit = variance_unit(used);
  const NormalEquations equations =
      BuildNormalEquations(used, *pose, std::numeric_limits<double>::infinity(), {up, unit});
  const Eigen::LDLT<Matrix6d> factors(equations.matrix);
  if (factors.info() != Eigen::Success || !factors.isPositive() || factors.vectorD().minCoeff() <= 0)
    return std::nullopt;
  refined.cam_from_world = *pose;
  refined.covariance = unit * factors.solve(Matrix6d::Identity());
  const Matrix6d of_readout = factors.solve(equations.of_readout) * equations.readout_sigmas.asDiagonal();
  refined.covariance += of_readout * of_readout.transpose();
  refined.covariance = 0.5 * (refined.covariance + refined.covariance.transpose()).eval();
  AddSystematic(options, &refined.covariance);
  if (!refined.covariance.allFinite()) return std::nullopt;
  return refined;
}

double LargestSigma(const Eigen::Matrix3d& covariance) {
  if (!covariance.allFinite()) return std::numeric_limits<double>::infinity();
  return std::sqrt(
      std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues().maxCoeff()));
}

Matrix6d TransformCovariance(const Pose& b_from_cam, const Matrix6d& covariance) {
  const Matrix6d adjoint = Adjoint(b_from_cam);
  return adjoint * covariance * adjoint.transpose();
}

}  // namespace cairn
