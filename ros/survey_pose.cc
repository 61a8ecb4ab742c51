#include "ros/survey_pose.h"

#include <algorithm>

#include "runtime/drive/route.h"

namespace cairn_ros {

using namespace cairn;  // NOLINT: this file is the bridge

Result<SurveyPose> SurveyPoseOf(const Map& map, int32_t image, const Pose& robot_from_camera) {
  CAIRN_ASSIGN_OR_RETURN(const Pose cam_from_world, PoseOfImage(map, image));
  const Pose world_from_robot = (robot_from_camera * cam_from_world).Inverse();
  SurveyPose pose;
  CAIRN_ASSIGN_OR_RETURN(pose.image, map.ImageName(image));
  std::copy_n(world_from_robot.translation.data(), 3, pose.position);
  std::copy_n(world_from_robot.rotation.coeffs().data(), 4, pose.orientation_xyzw);  // Eigen's order too
  return pose;
}

}  // namespace cairn_ros
