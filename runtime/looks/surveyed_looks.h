#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/geometry/planar_pose.h"
#include "runtime/map/map.h"

namespace cairn {

// What a robot's camera would be shown, and with what that can be confused: a map's survey images by where
// they were taken, and which places of its appearance graph look alike.
class SurveyedLooks {
 public:
  // `robot_in_camera`: the robot's frame in the camera's on the floor.  Errors: those of Map::Images and
  // Map::Appearance; NotFound where the map does not say which places look alike.
  static Result<SurveyedLooks> Make(const Map& map, const PlanarPose& robot_in_camera);

  // The place of the appearance graph that a robot sees at a pose: that of the nearest survey image within
  // 1 m and 30 degrees; -1: none.
  NodeIdx PlaceAt(const PlanarPose& robot) const;
  // Whether an image of the first could as well be of the second.  REQUIRES: places, not -1
  bool AreAlike(NodeIdx a, NodeIdx b) const;

 private:
  struct Look {
    PlanarPose camera;
    NodeIdx place = -1;
  };
  PlanarPose camera_in_robot_;
  std::vector<Look> looks_;                  // ascending by x of the camera's position
  std::vector<std::vector<NodeIdx>> alike_;  // of each place, ascending
};

}  // namespace cairn
