#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "runtime/drive/place_model.h"
#include "runtime/drive/start_hypotheses.h"
#include "runtime/map/map.h"
#include "sim/robot/robot.h"

namespace cairn::sim {

struct RobotDriveOptions {
  // Most images that it goes to.  REQUIRES: >= 1
  int max_num_legs = 200;
  // How often it may look anew where it is, after it got lost.  REQUIRES: >= 0
  int max_num_relocalizations = 5;
  // A place is held possible if so many matches with its image agree on one motion, as many as make a link
  // [Mariottini11 §V: 20]; the source, 0, takes what the words say.  REQUIRES: >= 0
  int min_start_inliers = 20;
  // Places that are checked so, those that score best.  REQUIRES: >= 1
  int max_num_start_checks = 40;
  RobotOptions robot;
  // On its way a robot is less exacting than a servo by default: no image is worth long shuttling.
  ServoOptions servo{.patience_commands = 40};
  StartHypothesesOptions hypotheses;
};
OptionTable DescribeOptions(RobotDriveOptions* options);

// One start that is held possible, as it was after some image.
struct DriveHypothesis {
  NodeIdx start = 0;
  PlanarPose start_pose;  // of its image
  double posterior = 0;
  std::vector<NodeIdx> path;
};

// A leg of the drive, and what was believed after it.
struct DriveLeg {
  std::string kind;         // "start", "go", "retrace", "relocalize"
  NodeIdx node = -1;        // gone to; -1: an image of its own
  PlanarPose target, pose;  // of its image; of the robot afterwards
  bool arrived = false;
  bool seen = false;  // as RobotLeg
  std::string why;
  std::vector<RobotStep> steps;
  // After the image taken at its end; empty where none was looked at.
  std::string verdict;  // "follow", "switch", "lost"
  std::vector<DriveHypothesis> hypotheses;
  int followed = 0;
};

struct RobotDrive {
  std::vector<DriveLeg> legs;
  int32_t goal_image = 0;
  PlanarPose start, goal;
  int num_switches = 0, num_relocalizations = 0;
  double way_m = 0;
  std::optional<Error> error;  // none: the robot says that it is there
  double goal_error_m = 0, goal_error_deg = 0;
};

// Carried away: before the robot goes to its `before_leg`-th image (0: the first) it is put elsewhere.
struct Kidnapping {
  int before_leg = 0;
  PlanarPose pose;
};

// A robot that does not know where it stands goes to where a survey image was taken [Mariottini11 §VI]: it
// looks, holds the places that look like that possible, follows the way of one of them from image to image
// by its servo, learns at each which of them is right, turns back over its own images when another one is,
// and looks anew when none explains what it sees or a servo gives up.  Errors: InvalidArgument (options, a
// start in a wall). A drive that fails is no error: its reason is RobotDrive::error: NoData (an image without
// features, or that shares nothing with the map), NotFound (no way to the goal), Lost.
Result<RobotDrive> DriveToImage(const Map& map, const PlaceModel& model, const Building& building,
                                const Camera& camera, double camera_height_m, const PlanarPose& start,
                                int32_t goal_image, const std::optional<Kidnapping>& kidnapping,
                                const RobotDriveOptions& options, uint64_t seed);

// The drive over the floor as SVG: obstacles, images of the ways, the robot's way, starts held possible, and
// their posteriors image by image below.
std::string DriveSvg(const RobotDrive& drive, const Building& building,
                     const std::vector<PlanarPose>& node_poses);

}  // namespace cairn::sim
