#include "stages/reconstruct/align.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "core/base/quantiles.h"

namespace cairn::reconstruct {
namespace {

constexpr double kMaxSigmas = 3;         // beyond this a target is off
constexpr double kMinSpreadSigmas = 2;   // root mean square of the targets about their centre
constexpr size_t kMaxHypotheses = 2000;  // from triples
constexpr size_t kMaxHypothesisTargets = 64;
constexpr double kMedianChiSquare = 2.366;  // of 3 degrees of freedom

Eigen::Quaterniond LevelRotation(const Eigen::Vector3d& up) {
  return Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ());
}

// Squared distance in standard deviations.
double SquaredSigmas(const PositionTarget& target, const Similarity& similarity) {
  return (target.world - similarity * target.model).cwiseQuotient(target.sigma_m).squaredNorm();
}

double Cost(const std::vector<PositionTarget>& targets, const Eigen::Vector3d& up, double up_sigma_rad,
            const Similarity& similarity) {
  const double up_error = (similarity.rotation * up - Eigen::Vector3d::UnitZ()).squaredNorm();
  double cost = std::log1p(up_error / (up_sigma_rad * up_sigma_rad));
  for (const PositionTarget& target : targets) cost += std::log1p(SquaredSigmas(target, similarity));
  return cost;
}

// Level, with the heading and the horizontal scale of two targets.
std::optional<Similarity> FromPair(const PositionTarget& a, const PositionTarget& b,
                                   const Eigen::Quaterniond& level) {
  const Eigen::Vector3d model = level * (b.model - a.model), world = b.world - a.world;
  const double model_length = model.head<2>().norm(), world_length = world.head<2>().norm();
  if (model_length < 1e-9 || world_length < 1e-9) return std::nullopt;
  const double yaw = std::atan2(world.y(), world.x()) - std::atan2(model.y(), model.x());
  Similarity similarity;
  similarity.scale = world_length / model_length;
  similarity.rotation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * level;
  similarity.translation =
      0.5 * (a.world + b.world) - similarity.scale * (similarity.rotation * (0.5 * (a.model + b.model)));
  return similarity;
}

std::optional<Similarity> FromTriple(const PositionTarget& a, const PositionTarget& b,
                                     const PositionTarget& c) {
  Eigen::Matrix3d model, world;
  model << a.model, b.model, c.model;
  world << a.world, b.world, c.world;
  const double area = (b.world - a.world).cross(c.world - a.world).norm();
  const double model_area = (b.model - a.model).cross(c.model - a.model).norm();
  if (area < 1e-9 || model_area < 1e-12) return std::nullopt;
  const Eigen::Matrix4d transform = Eigen::umeyama(model, world, true);
  const Eigen::Matrix3d linear = transform.topLeftCorner<3, 3>();
  Similarity similarity;
  similarity.scale = std::cbrt(linear.determinant());
  if (!(similarity.scale > 0) || !std::isfinite(similarity.scale)) return std::nullopt;
  similarity.rotation = Eigen::Quaterniond(Eigen::Matrix3d(linear / similarity.scale)).normalized();
  similarity.translation = transform.topRightCorner<3, 1>();
  return similarity;
}

// Indices of at most kMaxHypothesisTargets targets, evenly spread.
std::vector<size_t> SpreadIndices(size_t num_targets) {
  const size_t num = std::min(num_targets, kMaxHypothesisTargets);
  std::vector<size_t> indices(num);
  for (size_t i = 0; i < num; ++i) indices[i] = i * num_targets / num;
  return indices;
}

// The hypothesis of least cost; the first of equals.  Evenly spread over the pairs and triples where there
// are too many.
std::optional<Similarity> BestHypothesis(const std::vector<PositionTarget>& targets,
                                         const Eigen::Vector3d& up, double up_sigma_rad) {
  const Eigen::Quaterniond level = LevelRotation(up);
  std::optional<Similarity> best;
  double best_cost = 0;
  const auto consider = [&](const std::optional<Similarity>& hypothesis) {
    if (!hypothesis) return;
    const double cost = Cost(targets, up, up_sigma_rad, *hypothesis);
    if (best && cost >= best_cost) return;
    best = hypothesis;
    best_cost = cost;
  };
  const std::vector<size_t> chosen = SpreadIndices(targets.size());
  const size_t n = chosen.size();
  const size_t triple_step = n * (n - 1) * (n - 2) / 6 / kMaxHypotheses + 1;
  size_t num_triples = 0;
  for (size_t i = 0; i < n; ++i) {
    const PositionTarget& a = targets[chosen[i]];
    for (size_t j = i + 1; j < n; ++j) {
      const PositionTarget& b = targets[chosen[j]];
      consider(FromPair(a, b, level));
      for (size_t k = j + 1; k < n; ++k) {
        if (num_triples++ % triple_step == 0) consider(FromTriple(a, b, targets[chosen[k]]));
      }
    }
  }
  return best;
}

// Parameters: rotation vector on top of an initial rotation, logarithm of the scale's factor, translation.
struct PositionCost {
  const PositionTarget& target;
  const Similarity& initial;

  template <typename T>
  bool operator()(const T* turn, const T* log_factor, const T* translation, T* residual) const {
    const Eigen::Vector3d rotated = initial.scale * (initial.rotation * target.model);
    const T point[3] = {T(rotated.x()), T(rotated.y()), T(rotated.z())};
    T turned[3];
    ceres::AngleAxisRotatePoint(turn, point, turned);
    for (int i = 0; i < 3; ++i)
      residual[i] = (exp(log_factor[0]) * turned[i] + translation[i] - target.world[i]) / target.sigma_m[i];
    return true;
  }
};

struct UpCost {
  Eigen::Vector3d up;  // in the initially rotated frame
  double sigma_rad;

  template <typename T>
  bool operator()(const T* turn, T* residual) const {
    const T point[3] = {T(up.x()), T(up.y()), T(up.z())};
    T turned[3];
    ceres::AngleAxisRotatePoint(turn, point, turned);
    for (int i = 0; i < 3; ++i) residual[i] = (turned[i] - (i == 2 ? 1.0 : 0.0)) / sigma_rad;
    return true;
  }
};

Similarity Refine(const std::vector<PositionTarget>& targets, const Eigen::Vector3d& up, double up_sigma_rad,
                  const Similarity& initial) {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), translation = initial.translation;
  double log_factor = 0;
  ceres::CauchyLoss loss(1.0);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (const PositionTarget& target : targets) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<PositionCost, 3, 3, 1, 3>(new PositionCost{target, initial}), &loss,
        turn.data(), &log_factor, translation.data());
  }
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<UpCost, 3, 3>(new UpCost{initial.rotation * up, up_sigma_rad}), &loss,
      turn.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.num_threads = 1;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  Similarity refined;
  refined.scale = initial.scale * std::exp(log_factor);
  refined.rotation = initial.rotation;
  if (turn.norm() > 0)
    refined.rotation = (Eigen::AngleAxisd(turn.norm(), turn.normalized()) * initial.rotation).normalized();
  refined.translation = translation;
  return refined;
}

// Fills scale_sigma_ratio and centre.
void FillScaleSigma(const std::vector<PositionTarget>& targets, Alignment* alignment) {
  const Similarity& similarity = alignment->world_from_model;
  std::vector<double> squares;
  for (const PositionTarget& target : targets) squares.push_back(SquaredSigmas(target, similarity));
  const double noise = std::max(1.0, Median(squares) / kMedianChiSquare);
  std::vector<const PositionTarget*> used;
  Eigen::Vector3d weighted = Eigen::Vector3d::Zero(), weights = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < targets.size(); ++i) {
    if (squares[i] > kMaxSigmas * kMaxSigmas * noise) continue;
    used.push_back(&targets[i]);
    const Eigen::Vector3d weight = targets[i].sigma_m.cwiseAbs2().cwiseInverse();
    weighted += weight.cwiseProduct(similarity * targets[i].model);
    weights += weight;
  }
  alignment->centre = weighted.cwiseQuotient(weights);
  double information = 0;
  for (const PositionTarget* target : used) {
    information +=
        (similarity * target->model - alignment->centre).cwiseQuotient(target->sigma_m).squaredNorm();
  }
  alignment->scale_sigma_ratio = std::sqrt(noise / information);
}

Status CheckSpread(const std::vector<PositionTarget>& targets) {
  if (targets.size() < 3) {
    return MakeError(ErrorCode::kNoData, "{} images with a known position, expected at least 3",
                     targets.size());
  }
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const PositionTarget& target : targets) centre += target.world / static_cast<double>(targets.size());
  double squared_m = 0, max_sigma_m = 0;
  for (const PositionTarget& target : targets) {
    squared_m += (target.world - centre).squaredNorm() / static_cast<double>(targets.size());
    max_sigma_m = std::max(max_sigma_m, target.sigma_m.minCoeff());
  }
  if (std::sqrt(squared_m) >= kMinSpreadSigmas * max_sigma_m) return Ok();
  return MakeError(ErrorCode::kNoData,
                   "the known positions lie within {:.3g} m of each other (root mean square), which with a "
                   "standard deviation of {:.3g} m gives no scale",
                   std::sqrt(squared_m), max_sigma_m);
}

}  // namespace

Result<Alignment> AlignToPositions(const std::vector<PositionTarget>& targets,
                                   const Eigen::Vector3d& up_model, double up_sigma_deg) {
  CAIRN_RETURN_IF_ERROR(CheckSpread(targets));
  const double up_sigma_rad = RadFromDeg(up_sigma_deg);
  const std::optional<Similarity> initial = BestHypothesis(targets, up_model, up_sigma_rad);
  if (!initial) {
    return MakeError(ErrorCode::kNoData,
                     "the images with known positions are all at one place of the reconstruction, or one "
                     "above the other, which gives no scale");
  }
  Alignment alignment;
  alignment.world_from_model = Refine(targets, up_model, up_sigma_rad, *initial);
  for (const PositionTarget& target : targets) {
    alignment.residuals_m.push_back((target.world - alignment.world_from_model * target.model).norm());
    alignment.is_off.push_back(SquaredSigmas(target, alignment.world_from_model) > kMaxSigmas * kMaxSigmas);
  }
  FillScaleSigma(targets, &alignment);
  return alignment;
}

Result<DistanceScale> ScaleFromDistances(const std::vector<DistanceTarget>& targets,
                                         double distance_sigma_ratio) {
  std::vector<double> ratios;
  for (const DistanceTarget& target : targets) {
    if (target.model > 0 && target.world_m > 0) ratios.push_back(target.world_m / target.model);
  }
  if (ratios.empty())
    return MakeError(ErrorCode::kNoData, "no known distance between two images that were registered");
  const double scale = Median(ratios);
  std::vector<double> deviations;
  for (const double ratio : ratios) deviations.push_back(std::abs(ratio / scale - 1));
  const double of_one = std::max(distance_sigma_ratio, kSigmaOfMad * Median(deviations));
  const double of_median = ratios.size() > 2 ? kSigmaOfMedian : 1;  // of two it is the mean
  return DistanceScale{scale, of_median * of_one / std::sqrt(static_cast<double>(ratios.size()))};
}

Eigen::Vector3d MeanUp(const std::vector<Pose>& cams_from_model) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Pose& pose : cams_from_model) up -= pose.rotation.conjugate() * Eigen::Vector3d::UnitY();
  return up.norm() > 1e-6 ? up.normalized() : Eigen::Vector3d::UnitZ();
}

Similarity LevelledFrame(const std::vector<Pose>& cams_from_model, double scale) {
  return LevelledFrame(cams_from_model, scale, MeanUp(cams_from_model));
}

Similarity LevelledFrame(const std::vector<Pose>& cams_from_model, double scale, const Eigen::Vector3d& up) {
  Similarity similarity;
  similarity.scale = scale;
  const Eigen::Quaterniond level = LevelRotation(up);
  const Eigen::Vector3d view = level * cams_from_model.front().ViewingDirection();
  const double yaw = view.head<2>().norm() > 1e-6 ? std::atan2(view.y(), view.x()) : 0;
  similarity.rotation = Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()) * level;
  similarity.translation = -scale * (similarity.rotation * cams_from_model.front().Center());
  return similarity;
}

}  // namespace cairn::reconstruct
