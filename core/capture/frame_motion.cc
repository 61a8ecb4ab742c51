#include "core/capture/frame_motion.h"

#include <algorithm>

#include "core/base/quantiles.h"
#include "core/geometry/relative_pose.h"

namespace cairn {
namespace {

// Focal lengths that are tried, parts of the longer side: fields of view of 90, 71, 53 and 39 degrees.
constexpr double kLikelyFocals[] = {0.5, 0.7, 1.0, 1.4};
// Corners that are farther from where the rotation takes them count less.
constexpr double kScaleRad = 0.01;
constexpr int kNumIterations = 5;

Correspondences Bearings(const std::vector<cv::Point2f>& before, const std::vector<cv::Point2f>& after,
                         cv::Size frame_size, double focal_px) {
  const auto bearing = [&](const cv::Point2f& point) {
    return Eigen::Vector3d(point.x - 0.5 * frame_size.width, point.y - 0.5 * frame_size.height, focal_px)
        .normalized();
  };
  Correspondences bearings;
  for (size_t i = 0; i < before.size(); ++i)
    bearings.Add(bearing(before[i]), bearing(after[i]), static_cast<int>(i));
  return bearings;
}

// Median distance of the corners from where the rotation that fits best takes them, pixels.
double DistanceFromRotated(const std::vector<cv::Point2f>& before, const std::vector<cv::Point2f>& after,
                           cv::Size frame_size, double focal_px) {
  const Correspondences bearings = Bearings(before, after, frame_size, focal_px);
  const Eigen::Quaterniond rotation =
      RefineRotation(Eigen::Quaterniond::Identity(), bearings, kScaleRad, kNumIterations);
  std::vector<double> distances;
  for (size_t i = 0; i < before.size(); ++i) {
    const Eigen::Vector3d rotated = rotation * bearings.bearings1[i];
    // A corner that the rotation takes behind the camera is far from any.
    const double depth = std::max(rotated.z(), 1e-3);
    const Eigen::Vector2d expected = focal_px * rotated.head<2>() / depth;
    const Eigen::Vector2d found(after[i].x - 0.5 * frame_size.width, after[i].y - 0.5 * frame_size.height);
    distances.push_back((found - expected).norm());
  }
  return Median(distances);
}

}  // namespace

FrameMotion MeasureMotion(const std::vector<cv::Point2f>& before, const std::vector<cv::Point2f>& after,
                          cv::Size frame_size, double focal_px) {
  if (before.empty()) return {};
  const double side = std::max(frame_size.width, frame_size.height);
  std::vector<double> shifts;
  for (size_t i = 0; i < before.size(); ++i) shifts.push_back(cv::norm(after[i] - before[i]));
  FrameMotion motion{.shift = Median(shifts) / side, .parallax = 0};
  motion.parallax = motion.shift;
  if (focal_px > 0) {
    motion.parallax = DistanceFromRotated(before, after, frame_size, focal_px) / side;
    return motion;
  }
  for (const double focal : kLikelyFocals) {
    motion.parallax =
        std::min(motion.parallax, DistanceFromRotated(before, after, frame_size, focal * side) / side);
  }
  return motion;
}

}  // namespace cairn
