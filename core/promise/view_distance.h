#pragma once

#include <cstddef>
#include <vector>

#include "core/camera/camera.h"
#include "core/geometry/pose.h"
#include "core/world/feature_class.h"

namespace cairn {

// How far a robot's image is from the survey's images, where the survey was as dense as it needs to be: two
// images are one view when
//   (distance / (same_view_ratio depth))^2 + (rotation / same_view_deg)^2 < 1,
// depth = median distance of what survey images see.
struct ViewOptions {
  double same_view_ratio = 0.1;  // REQUIRES: > 0
  double same_view_deg = 15;     // REQUIRES: > 0
};

// Whether a point (world frame) lies in front of a camera and projects into its image.
bool IsInView(const Camera& camera, const Pose& cam_from_world, const Eigen::Vector3d& point);

// Square of the distance of two views in radii, a view's radius being `radius_m` and `radius_deg`.
double ViewDistanceSquared(const Pose& a, const Pose& b, double radius_m, double radius_deg);

// The distance of two survey images in radii of a view.
class ViewDistance {
 public:
  ViewDistance(const Classes& classes, const ViewOptions& options);

  // `a`, `b`: positions in Classes::images.
  double operator()(size_t a, size_t b) const;
  double Squared(size_t a, size_t b) const;
  // Of any pose and survey image `b`.
  double Squared(const Pose& cam_from_world, size_t b) const;
  // Metres, or the map's units.
  double depth() const { return depth_; }
  // Of a view: metres, or the map's units.
  double radius() const { return options_.same_view_ratio * depth_; }
  double radius_deg() const { return options_.same_view_deg; }

 private:
  double Squared(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& center, size_t b) const;

  std::vector<Pose> poses_;
  std::vector<Eigen::Vector3d> centers_;
  double depth_ = 1;
  ViewOptions options_;
};

}  // namespace cairn
