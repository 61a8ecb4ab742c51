#include "core/geometry/floor_pose.h"

namespace cairn {

FloorPose FloorPoseOf(const Pose& cam_from_world, const Pose& floor_from_world) {
  const Eigen::Vector3d center = floor_from_world * cam_from_world.Center();
  Eigen::Vector3d forward = floor_from_world.rotation * cam_from_world.ViewingDirection();
  constexpr double kLeastLevel = 0.26;  // within 15 degrees of the vertical its direction says little
  if (forward.head<2>().norm() < kLeastLevel)
    forward = floor_from_world.rotation * (cam_from_world.rotation.conjugate() * -Eigen::Vector3d::UnitY());
  double heading_deg = DegFromRad(std::atan2(forward.y(), forward.x()));
  if (heading_deg < 0) heading_deg += 360;
  if (heading_deg >= 360) heading_deg = 0;  // of a turn that is as good as none
  return {center.head<2>(), heading_deg};
}

}  // namespace cairn
