#pragma once

#include <Eigen/Core>

#include "core/geometry/pose.h"
#include "runtime/localize/localization.h"
#include "runtime/visual_map/visual_estimate.h"

namespace cairn {

// A fix in space as the visual map would state it: on the floor.
struct FloorFix {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // floor frame, metres
  double heading_deg = 0;
  // x m, y m, heading rad; without the error of the map's scale, which estimates by one map share.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};
// REQUIRES: localization.has_fix()
FloorFix FloorFixOf(const Localization& localization, const Pose& floor_from_world);

// The distance between two estimates that share only the keypoints: a check of one by the other.
struct Disagreement {
  double distance_m = 0;
  double angle_deg = 0;
  // Mahalanobis distance in (x, y, heading) under the sum of both covariances, without the map's scale:
  // beyond 4 they contradict each other.
  double mahalanobis = 0;
};
Disagreement Compare(const FloorFix& fix, const VisualPose& pose);

}  // namespace cairn
