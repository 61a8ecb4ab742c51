#include "core/structure/triangulate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Dense>

namespace cairn {
namespace {

constexpr int kMaxHypotheses = 15;
constexpr int kMaxIterations = 8;

// World directions and centres of the rays.
struct Line {
  Eigen::Vector3d center;
  Eigen::Vector3d direction;
};

// Middle of the shortest segment between two lines; nothing when they are parallel.
std::optional<Eigen::Vector3d> Midpoint(const Line& a, const Line& b) {
  const double cosine = a.direction.dot(b.direction);
  const double denominator = 1 - cosine * cosine;
  if (denominator < 1e-8) return std::nullopt;
  const Eigen::Vector3d baseline = b.center - a.center;
  const double along_a = (baseline.dot(a.direction) - cosine * baseline.dot(b.direction)) / denominator;
  const double along_b = (cosine * baseline.dot(a.direction) - baseline.dot(b.direction)) / denominator;
  return 0.5 * (a.center + along_a * a.direction + b.center + along_b * b.direction);
}

// Squared reprojection error in pixels; infinite where the point is not in front of the ray.
double SquaredError(const PosedRay& ray, const Eigen::Vector3d& position) {
  const Eigen::Vector3d p = ray.cam_from_world * position;
  if (ray.ray.normal.dot(p) <= 1e-6) return std::numeric_limits<double>::infinity();
  return ray.ray.Residual(p).squaredNorm();
}

std::vector<int> RaysWithin(const std::vector<PosedRay>& rays, const Eigen::Vector3d& position,
                            double max_error, double* total) {
  std::vector<int> inliers;
  *total = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    const double squared = SquaredError(rays[i], position);
    if (squared > max_error * max_error) continue;
    inliers.push_back(static_cast<int>(i));
    *total += squared;
  }
  return inliers;
}

// Normal matrix and gradient of the squared reprojection error in pixels.
void Accumulate(const PosedRay& ray, const Eigen::Vector3d& position, Eigen::Matrix3d* normal,
                Eigen::Vector3d* gradient) {
  const Eigen::Matrix3d R = ray.cam_from_world.rotation.toRotationMatrix();
  const Eigen::Vector3d p = R * position + ray.cam_from_world.translation;
  const Eigen::Vector2d residual = ray.ray.Residual(p);
  const Eigen::Matrix<double, 2, 3> jacobian = ray.ray.ResidualByPoint(p) * R;
  *normal += jacobian.transpose() * jacobian;
  *gradient += jacobian.transpose() * residual;
}

// Pairs of indices below n that spread over the track: neighbours at growing distance.
std::vector<std::pair<int, int>> SpreadPairs(int n) {
  std::vector<std::pair<int, int>> pairs;
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j) pairs.emplace_back(i, j);
  }
  if (pairs.size() <= kMaxHypotheses) return pairs;
  std::vector<std::pair<int, int>> chosen;
  for (int h = 0; h < kMaxHypotheses; ++h)
    chosen.push_back(pairs[h * (pairs.size() - 1) / (kMaxHypotheses - 1)]);
  return chosen;
}

// The largest angle at the position between two inliers.
double MaxAngleDeg(const Triangulation& triangulation, const std::vector<Line>& lines) {
  std::vector<Eigen::Vector3d> ways;
  std::vector<double> lengths;
  double min_cosine = 1;
  for (const int i : triangulation.inliers) {
    const Eigen::Vector3d way = triangulation.position - lines[i].center;
    const double length = way.norm();
    for (size_t k = 0; k < ways.size(); ++k)
      min_cosine = std::min(min_cosine, ways[k].dot(way) / (lengths[k] * length));
    ways.push_back(way);
    lengths.push_back(length);
  }
  return DegFromRad(std::acos(std::clamp(min_cosine, -1.0, 1.0)));
}

}  // namespace

Triangulation Triangulate(const std::vector<PosedRay>& rays, const TriangulateOptions& options) {
  Triangulation result;
  if (static_cast<int>(rays.size()) < options.min_num_observations) return result;
  std::vector<Line> lines;
  for (const PosedRay& ray : rays) {
    lines.push_back({ray.cam_from_world.Center(), ray.cam_from_world.rotation.conjugate() * ray.ray.bearing});
  }
  double least_total = 0;
  for (const auto& [i, j] : SpreadPairs(static_cast<int>(rays.size()))) {
    const auto position = Midpoint(lines[i], lines[j]);
    if (!position) continue;
    double total = 0;
    std::vector<int> inliers = RaysWithin(rays, *position, options.max_reprojection_error_px, &total);
    if (inliers.size() > result.inliers.size() ||
        (inliers.size() == result.inliers.size() && total < least_total)) {
      result.inliers = std::move(inliers);
      result.position = *position;
      least_total = total;
    }
  }
  // Refine on the rays that agree, then find those that agree with the refined point; twice.
  for (int round = 0; round < 2; ++round) {
    if (static_cast<int>(result.inliers.size()) < options.min_num_observations) return result;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
      Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
      for (const int i : result.inliers) Accumulate(rays[i], result.position, &normal, &gradient);
      const Eigen::Vector3d step = normal.ldlt().solve(-gradient);
      if (!step.allFinite()) break;
      result.position += step;
      if (step.norm() < 1e-8) break;
    }
    double total = 0;
    result.inliers = RaysWithin(rays, result.position, options.max_reprojection_error_px, &total);
    result.rms_error_px = std::sqrt(total / static_cast<double>(std::max<size_t>(1, result.inliers.size())));
  }
  if (static_cast<int>(result.inliers.size()) < options.min_num_observations) return result;

  if (MaxAngleDeg(result, lines) < options.min_triangulation_angle_deg) {
    result.outcome = TriangulateOutcome::kSmallAngle;
    return result;
  }
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (const int i : result.inliers) Accumulate(rays[i], result.position, &normal, &gradient);
  result.covariance = normal.inverse();
  result.covariance = (0.5 * (result.covariance + result.covariance.transpose())).eval();
  result.outcome = TriangulateOutcome::kOk;
  return result;
}

}  // namespace cairn
