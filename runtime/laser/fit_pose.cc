#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "core/geometry/vector_geometry.h"
#include "runtime/laser/interpretation_tree.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr int kMaxSteps = 8;
constexpr double kSmallestStep = 1e-7;  // metres and radians

// The visible part of a wall ends where the wall does or before: an end beyond it pulls the pose back.
void AddEndsBeyondWalls(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
                        const Interpretation& found, Eigen::Matrix3d* information,
                        Eigen::Vector3d* gradient) {
  const Eigen::Rotation2Dd rotation(found.pose.heading_rad);
  for (size_t i = 0; i < segments.size(); ++i) {
    if (found.labels[i] < 0) continue;
    const Vec2 start = LabelStart(plan, found.labels[i]), end = LabelEnd(plan, found.labels[i]);
    const double length = (end - start).norm();
    const Vec2 along = (end - start) / length;
    const double weight = 1 / std::pow(std::max(1e-6, segments[i].sigma_end_m), 2);
    for (const Vec2& seen : {segments[i].start, segments[i].end}) {
      const Vec2 arm = rotation * seen;
      const double place = along.dot(found.pose.position + arm - start);
      if (place >= 0 && place <= length) continue;
      const Eigen::Vector3d row(along.x(), along.y(), along.dot(Vec2(-arm.y(), arm.x())));
      *information += weight * row * row.transpose();
      *gradient += weight * row * (std::clamp(place, 0.0, length) - place);
    }
  }
}

}  // namespace

double SquaredOffsets(const FloorPlan& plan, const ScanSegment& segment, LabelIdx label,
                      const PlanarPose& pose) {
  const Vec2 start = LabelStart(plan, label), along = (LabelEnd(plan, label) - start).normalized();
  double sum = 0;
  for (const Vec2& end : {segment.start, segment.end})
    sum += std::pow(Cross(along, pose.FloorFromRobot(end) - start), 2);
  return sum;
}

void FitPose(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
             Interpretation* interpretation) {
  Interpretation& found = *interpretation;
  found.num_matched = 0;
  found.matched_length_m = 0;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  // Heading: weighted mean of those of the pairings.
  double weight_sum = 0, reference = 0, heading = 0;
  for (size_t i = 0; i < segments.size(); ++i) {
    if (found.labels[i] < 0) continue;
    const Vec2 along = LabelEnd(plan, found.labels[i]) - LabelStart(plan, found.labels[i]);
    const double angle = std::atan2(along.y(), along.x()) - segments[i].Angle();
    const double weight = 1 / std::pow(std::max(1e-6, segments[i].sigma_angle_rad), 2);
    if (found.num_matched == 0) reference = angle;
    heading += weight * WrapAngle(angle - reference);
    weight_sum += weight;
    ++found.num_matched;
    found.matched_length_m += segments[i].Length();
  }
  if (found.num_matched == 0) return;
  found.pose.heading_rad = WrapAngle(reference + heading / weight_sum);
  // Place and heading together, by Gauss-Newton; ends count once there is a place.
  Vec2 middle_of_range = Vec2::Zero();
  for (int step = 0; step < kMaxSteps; ++step) {
    information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    middle_of_range = Vec2::Zero();
    const Eigen::Rotation2Dd rotation(found.pose.heading_rad);
    for (size_t i = 0; i < segments.size(); ++i) {
      if (found.labels[i] < 0) continue;
      const Vec2 start = LabelStart(plan, found.labels[i]), end = LabelEnd(plan, found.labels[i]);
      const Vec2 along = (end - start).normalized(), normal(-along.y(), along.x());
      const Vec2 arm = rotation * segments[i].Middle();
      middle_of_range += (0.5 * (start + end) - arm) / found.num_matched;
      const double angle_weight = 1 / std::pow(std::max(1e-6, segments[i].sigma_angle_rad), 2);
      const double angle =
          WrapAngle(std::atan2(along.y(), along.x()) - segments[i].Angle() - found.pose.heading_rad);
      information(2, 2) += angle_weight;
      gradient[2] += angle_weight * angle;
      const double offset_weight = 1 / std::pow(std::max(1e-6, segments[i].sigma_offset_m), 2);
      const double offset = -normal.dot(found.pose.position + arm - start);
      const Eigen::Vector3d row(normal.x(), normal.y(), normal.dot(Vec2(-arm.y(), arm.x())));
      information += offset_weight * row * row.transpose();
      gradient += offset_weight * row * offset;
    }
    // Along a direction that nothing fixes, the pose goes to the middle of where the segments may lie.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(information.topLeftCorner<2, 2>().eval());
    found.determined = solver.eigenvalues()[0] > 1e-3 * solver.eigenvalues()[1];
    if (!found.determined) {
      const Vec2 free = solver.eigenvectors().col(0);
      double range = 1;
      for (size_t i = 0; i < segments.size(); ++i) {
        if (found.labels[i] < 0) continue;
        range = std::max(range, (LabelEnd(plan, found.labels[i]) - LabelStart(plan, found.labels[i])).norm() -
                                    segments[i].Length());
      }
      const Eigen::Vector3d row(free.x(), free.y(), 0);
      const double weight = 1 / (range * range);
      information += weight * row * row.transpose();
      gradient += weight * row * free.dot(middle_of_range - found.pose.position);
    } else if (step > 0) {
      AddEndsBeyondWalls(plan, segments, found, &information, &gradient);
    }
    const Eigen::Vector3d change = information.ldlt().solve(gradient);
    found.pose.position += change.head<2>();
    found.pose.heading_rad = WrapAngle(found.pose.heading_rad + change[2]);
    if (step > 1 && change.norm() < kSmallestStep) break;
  }
  found.covariance = information.inverse();
  double sum = 0;
  for (size_t i = 0; i < segments.size(); ++i) {
    if (found.labels[i] >= 0) sum += SquaredOffsets(plan, segments[i], found.labels[i], found.pose);
  }
  found.rms_m = std::sqrt(sum / (2 * found.num_matched));
}

}  // namespace cairn
