#include "stages/check_map/truth_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <ceres/ceres.h>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "core/base/quantiles.h"

namespace cairn::check_map {
namespace {

constexpr size_t kMinNumFixes = 6;

// Scale's logarithm, rotation (angle axis), translation; rotation and centre of the offset.
using Parameters = std::array<double, 13>;

TruthFit FitOf(const Parameters& p) {
  const auto rotation = [](const double* v) {
    const Eigen::Map<const Eigen::Vector3d> axis(v);
    return axis.norm() > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(axis.norm(), axis.normalized()))
                           : Eigen::Quaterniond::Identity();
  };
  TruthFit fit;
  fit.truth_from_map.scale = std::exp(p[0]);
  fit.truth_from_map.rotation = rotation(p.data() + 1);
  fit.truth_from_map.translation = Eigen::Map<const Eigen::Vector3d>(p.data() + 4);
  fit.truth_cam_from_cam.rotation = rotation(p.data() + 7);
  fit.truth_cam_from_cam.translation = Eigen::Map<const Eigen::Vector3d>(p.data() + 10);
  return fit;
}

Pose Predict(const TruthFit& fit, const Pose& cam_from_map) {
  return TransformPose(fit.truth_from_map, fit.truth_cam_from_cam * cam_from_map);
}

void SetErrors(const std::vector<FixAndTruth>& fixes, TruthFit* fit) {
  for (const FixAndTruth& pair : fixes) {
    const Pose predicted = Predict(*fit, pair.fix);
    fit->errors_m.push_back(CenterErrorM(predicted, pair.truth));
    fit->errors_deg.push_back(RotationErrorDeg(predicted, pair.truth));
  }
}

// Rotation and centre of a predicted pose against the truth, in units of sigma.
struct FixCost {
  const FixAndTruth& pair;
  double sigma_rad, sigma_m;

  bool operator()(const double* parameters, double* residual) const {
    Parameters p;
    std::copy_n(parameters, p.size(), p.begin());
    const Pose predicted = Predict(FitOf(p), pair.fix);
    const Eigen::Quaterniond difference = predicted.rotation * pair.truth.rotation.conjugate();
    const double sign = difference.w() < 0 ? -1 : 1;
    const Eigen::Vector3d place = predicted.Center() - pair.truth.Center();
    for (int i = 0; i < 3; ++i) {
      residual[i] = 2 * sign * difference.vec()[i] / sigma_rad;
      residual[3 + i] = place[i] / sigma_m;
    }
    return true;
  }
};

// The offset is of a rig: decimetres and degrees, where fixes do not tell.
struct OffsetPrior {
  bool operator()(const double* parameters, double* residual) const {
    for (int i = 0; i < 6; ++i) residual[i] = parameters[7 + i] / (i < 3 ? RadFromDeg(30) : 0.3);
    return true;
  }
};

// Whether points spread in two directions: the second singular value is a hundredth of the first or more.
bool Spread(const Eigen::Matrix3Xd& points) {
  const Eigen::Matrix3Xd centred = points.colwise() - points.rowwise().mean().eval();
  const Eigen::Vector3d values = Eigen::JacobiSVD<Eigen::Matrix3Xd>(centred).singularValues();
  return values[0] > 1e-6 * std::max(1.0, points.cwiseAbs().maxCoeff()) && values[1] > 0.01 * values[0];
}

}  // namespace

std::optional<TruthFit> FitTruth(const std::vector<FixAndTruth>& fixes, bool with_offset) {
  if (fixes.size() < kMinNumFixes) return std::nullopt;
  Eigen::Matrix3Xd map(3, fixes.size()), truth(3, fixes.size());
  for (size_t i = 0; i < fixes.size(); ++i) {
    map.col(static_cast<Eigen::Index>(i)) = fixes[i].fix.Center();
    truth.col(static_cast<Eigen::Index>(i)) = fixes[i].truth.Center();
  }
  if (!Spread(map) || !Spread(truth)) return std::nullopt;
  const Eigen::Matrix4d start = Eigen::umeyama(map, truth);
  const double scale = std::cbrt(start.topLeftCorner<3, 3>().determinant());
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(start.topLeftCorner<3, 3>() / scale));
  Parameters p{};
  p[0] = std::log(scale);
  Eigen::Map<Eigen::Vector3d>(p.data() + 1) = turn.angle() * turn.axis();
  Eigen::Map<Eigen::Vector3d>(p.data() + 4) = start.topRightCorner<3, 1>();
  if (!(scale > 0) || !Eigen::Map<Eigen::Matrix<double, 13, 1>>(p.data()).allFinite()) return std::nullopt;
  // The loss's scale is what remains, which each round knows better.
  for (int round = 0; round < 4; ++round) {
    TruthFit fit = FitOf(p);
    SetErrors(fixes, &fit);
    const double sigma_m = std::max(1e-6, UpperMedian(fit.errors_m)),
                 sigma_rad = std::max(1e-6, RadFromDeg(UpperMedian(fit.errors_deg)));
    ceres::Problem problem;
    for (const FixAndTruth& pair : fixes) {
      problem.AddResidualBlock(new ceres::NumericDiffCostFunction<FixCost, ceres::CENTRAL, 6, 13>(
                                   new FixCost{pair, sigma_rad, sigma_m}),
                               new ceres::CauchyLoss(2), p.data());
    }
    problem.AddResidualBlock(
        new ceres::NumericDiffCostFunction<OffsetPrior, ceres::CENTRAL, 6, 13>(new OffsetPrior), nullptr,
        p.data());
    if (!with_offset) problem.SetManifold(p.data(), new ceres::SubsetManifold(13, {7, 8, 9, 10, 11, 12}));
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
  }
  TruthFit fit = FitOf(p);
  SetErrors(fixes, &fit);
  return fit;
}

}  // namespace cairn::check_map
