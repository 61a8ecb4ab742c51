#pragma once

#include <cstdint>

#include "core/base/error.h"
#include "core/geometry/pose.h"
#include "ros/map_localizer.h"
#include "runtime/map/map.h"

namespace cairn_ros {

// Where a robot stands whose camera is where a survey image was taken.  Errors: as PoseOfImage.
cairn::Result<SurveyPose> SurveyPoseOf(const cairn::Map& map, int32_t image,
                                       const cairn::Pose& robot_from_camera);

}  // namespace cairn_ros
