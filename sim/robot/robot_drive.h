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
  // Largest number of images that it goes to.  REQUIRES: >= 1
  int max_num_legs = 200;
  // How often it may localize itself again after it got lost.  REQUIRES: >= 0
  int max_num_relocalizations = 5;
  // A place is a possible start if this many matches with its image agree on one motion, as many as make a
  // link [Mariottini11 §V: 20].  0: scores of words decide, as in the source.  REQUIRES: >= 0
  int min_start_inliers = 20;
  // Number of places that are checked in this way, those that score best.  REQUIRES: >= 1
  int max_num_start_checks = 40;
  RobotOptions robot;
  ServoOptions servo{.patience_commands = kDrivePatienceCommands};
  StartHypothesesOptions hypotheses;
};
OptionTable DescribeOptions(RobotDriveOptions* options);

// One possible start, as it was after some image.
struct DriveHypothesis {
  NodeIdx start = 0;
  PlanarPose start_pose;  // of its image
  double posterior = 0;
  std::vector<NodeIdx> path;
};

// A leg of the drive, and the hypotheses after it.
struct DriveLeg {
  std::string kind;         // "start", "go", "retrace", "relocalize"
  NodeIdx node = -1;        // the node that it goes to; -1: one of its own images
  PlanarPose target, pose;  // of its image; of the robot afterwards
  bool arrived = false;
  bool seen = false;  // as RobotLeg
  std::string why;
  std::vector<RobotStep> steps;
  // After the image taken at its end; empty where none was used.
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
  std::optional<Error> error;  // none: the robot says that it has arrived
  double goal_error_m = 0, goal_error_deg = 0;
};

// The robot is carried away: before it goes to its `before_leg`-th image (0: the first) it is put elsewhere.
struct Kidnapping {
  int before_leg = 0;
  PlanarPose pose;
};

// A robot that does not know where it stands goes to where a survey image was taken [Mariottini11 §VI]: it
// looks, takes the places that look like this as possible starts, follows the way from one of them from image
// to image by its servo, learns at each image which start is right, turns back over its own images when
// another one is, and localizes itself again when no start explains what it sees or a servo gives up.
// Errors: InvalidArgument (options, a start in a wall).  A drive that fails is no error: its reason is
// RobotDrive::error: NoData (an image without features, or that shares nothing with the map), NotFound (no
// way to the goal), Lost.
Result<RobotDrive> DriveToImage(const Map& map, const PlaceModel& model, const Building& building,
                                const Camera& camera, double camera_height_m, const PlanarPose& start,
                                int32_t goal_image, const std::optional<Kidnapping>& kidnapping,
                                const RobotDriveOptions& options, uint64_t seed);

// The drive over the floor as SVG: obstacles, images of the ways, the robot's way, possible starts, and their
// posteriors image by image below.
std::string DriveSvg(const RobotDrive& drive, const Building& building,
                     const std::vector<PlanarPose>& node_poses);

}  // namespace cairn::sim
