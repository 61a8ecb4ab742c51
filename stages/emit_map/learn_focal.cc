#include "stages/emit_map/learn_focal.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace cairn::emit_map {
namespace {

constexpr double kErrorPx = 2;
constexpr size_t kMinNumLandmarks = 20, kMinNumSights = 4;
// Enough to estimate one number.
constexpr size_t kMaxNumLandmarks = 500;
constexpr double kLeastWidths = 0.2, kMostWidths = 5;
constexpr int kNumSteps = 40;
constexpr int kNumGoldenSteps = 30;
constexpr double kBehindPx = 1e4;

struct Axes {
  Eigen::Vector2d forward, right;
};

double Length(const Eigen::Vector2d& of_sight, double focal_px) {
  return of_sight[0] + focal_px * of_sight[1];
}

Axes AxesOf(const FloorSight& sight) {
  const double c = std::cos(sight.heading_rad), s = std::sin(sight.heading_rad);
  return {{c, s}, {s, -c}};
}

// Where the sights meet: least squares of angular distances, starting from least squares of lengths.
Eigen::Vector2d MeetingPoint(const std::vector<FloorSight>& sights, double focal_px) {
  Eigen::Vector2d point = Eigen::Vector2d::Zero();
  for (int round = 0; round < 3; ++round) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right_side = Eigen::Vector2d::Zero();
    for (const FloorSight& sight : sights) {
      const auto [forward, right] = AxesOf(sight);
      const Eigen::Vector2d across =
          (Length(sight.right, focal_px) * forward - Length(sight.ahead, focal_px) * right).normalized();
      const double weight = round == 0 ? 1 : 1 / std::max(0.01, (point - sight.place).squaredNorm());
      normal += weight * across * across.transpose();
      right_side += weight * across.dot(sight.place) * across;
    }
    if (!(std::abs(normal.determinant()) > 1e-12)) break;
    point = normal.inverse() * right_side;
  }
  return point;
}

double Cost(const std::vector<std::vector<FloorSight>>& landmarks, double focal_px) {
  double cost = 0;
  for (const std::vector<FloorSight>& sights : landmarks) {
    const Eigen::Vector2d point = MeetingPoint(sights, focal_px);
    for (const FloorSight& sight : sights) {
      const auto [forward, right] = AxesOf(sight);
      const double ahead = forward.dot(point - sight.place);
      const double ratio = Length(sight.right, focal_px) / Length(sight.ahead, focal_px);
      const double error =
          ahead > 0 ? focal_px * (right.dot(point - sight.place) / ahead - ratio) : kBehindPx;
      cost += std::log1p(error * error / (kErrorPx * kErrorPx));
    }
  }
  return cost;
}

}  // namespace

double LearnFocal(const std::vector<std::vector<FloorSight>>& landmarks, int image_width_px) {
  std::vector<std::vector<FloorSight>> used;
  for (const std::vector<FloorSight>& sights : landmarks) {
    if (sights.size() >= kMinNumSights) used.push_back(sights);
  }
  if (used.size() < kMinNumLandmarks) return 0;
  if (used.size() > kMaxNumLandmarks) {
    for (size_t i = 0; i < kMaxNumLandmarks; ++i) used[i] = used[i * used.size() / kMaxNumLandmarks];
    used.resize(kMaxNumLandmarks);
  }
  const auto at = [&](double step) {
    return image_width_px * kLeastWidths * std::pow(kMostWidths / kLeastWidths, step / kNumSteps);
  };
  int best = 0;
  double least = Cost(used, at(0));
  for (int step = 1; step <= kNumSteps; ++step) {
    const double cost = Cost(used, at(step));
    if (cost < least) best = step, least = cost;
  }
  if (best == 0 || best == kNumSteps) return 0;
  // Golden section between the neighbours of the best step.
  constexpr double kGolden = 0.6180339887498949;
  double low = best - 1, high = best + 1;
  for (int i = 0; i < kNumGoldenSteps; ++i) {
    const double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
    if (Cost(used, at(left)) < Cost(used, at(right))) {
      high = right;
    } else {
      low = left;
    }
  }
  return at((low + high) / 2);
}

}  // namespace cairn::emit_map
