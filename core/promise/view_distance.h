#pragma once

#include <cstddef>
#include <vector>

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

// The distance of two survey images in radii of a view.
class ViewDistance {
 public:
  ViewDistance(const Classes& classes, const ViewOptions& options);

  // `a`, `b`: positions in Classes::images.
  double operator()(size_t a, size_t b) const;
  double Squared(size_t a, size_t b) const;
  // Metres, or the map's units.
  double depth() const { return depth_; }

 private:
  std::vector<Pose> poses_;
  std::vector<Eigen::Vector3d> centers_;
  double depth_ = 1;
  ViewOptions options_;
};

}  // namespace cairn
