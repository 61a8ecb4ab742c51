#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/features/features.h"
#include "core/features/sift.h"
#include "core/geometry/planar_pose.h"
#include "core/options/options.h"
#include "runtime/drive/image_servo.h"
#include "runtime/map/map.h"
#include "sim/render/building.h"
#include "sim/render/renderer.h"
#include "sim/robot/sensors.h"

namespace cairn::sim {

struct RobotOptions {
  // How it gets to where an image was taken: "epipolar", by the servo (runtime/drive/servo.h); "ideal", put
  // there with the noise below, or at the same-looking place in the other twin wing, where that is nearer:
  // for statistics over many drives.
  std::string servo = "epipolar";
  // Standard deviations of the ideal servo, per axis and of the heading.  REQUIRES: >= 0
  double ideal_noise_m = 0.05;
  double ideal_noise_deg = 2;
  // The ideal servo reaches places that are no farther than this, metres.  REQUIRES: > 0
  double ideal_reach_m = 4;
  // The assumed focal length over the camera's.  REQUIRES: in [0.5, 2]
  double focal_ratio = 1;
  // Radius of the robot: it stops at walls and furniture.  REQUIRES: in [0, 2]
  double radius_m = 0.15;
  // Most commands to one image.  REQUIRES: >= 1
  int max_num_commands = 120;
  PassOptions pass;
  SensorOptions sensors;
  SiftOptions sift{.max_num_features = 800};
};
OptionTable DescribeOptions(RobotOptions* options);

// Where the robot goes: what it sees there, and the place, which only the ideal servo uses.
struct RobotTarget {
  ServoTarget target;
  PlanarPose pose;
};

// Where a survey image was taken.  Errors: as cairn::TargetOfImage.
Result<RobotTarget> RobotTargetOf(const Map& map, int32_t image);
// The place of a survey image on the floor of the capture's frame.
PlanarPose PlanarPoseOf(const Pose& cam_from_world);

struct RobotStep {
  PlanarPose pose;       // before the command
  ServoCommand command;  // epipoles left out
};

struct RobotLeg {
  bool arrived = false;
  bool seen = false;  // the target's matches agreed on a motion at least once
  std::string why;    // of the last command
  std::vector<RobotStep> steps;
};

// A robot with a camera in a synthetic building; its pose is the camera's, which is where the servo's options
// say.  Deterministic by its seed.
class Robot {
 public:
  // `building` must outlive it.  Errors: InvalidArgument (options; an invalid camera).
  static Result<Robot> Create(const Building& building, const Camera& camera, double camera_height_m,
                              const RobotOptions& options, const ServoOptions& servo_options, uint64_t seed);

  const PlanarPose& pose() const { return pose_; }
  // Puts it anywhere; it forgets its last image.
  void PutAt(const PlanarPose& pose) {
    pose_ = pose;
    motion_ = {};
    last_target_.reset();
  }

  // The features of its current image, blurred by how it moves.
  Features Look();
  // Matches of such features with a target that agree on one motion over the floor; 0 where none do.
  int NumAgreeing(const Features& seen, const ServoTarget& target) const;
  // Goes to where an image was taken.  If there are no matches with the target, it searches by turning on
  // the spot.
  RobotLeg GoTo(const RobotTarget& target, bool is_goal);

 private:
  Robot(const Building& building, const Camera& camera, double camera_height_m, const RobotOptions& options,
        const ServoOptions& servo_options, uint64_t seed);
  RobotLeg GoIdeally(const RobotTarget& target);
  RobotLeg Steer(const ServoTarget& target, bool is_goal);
  Camera AssumedCamera() const;
  // The middle of the axle, about which it turns, and the camera's place on the robot.
  PlanarPose Axle() const;
  void PutAxleAt(const PlanarPose& axle);
  PlanarPose Mounting() const;
  bool Move(const ServoCommand& command);
  void TurnOnTheSpot(double turn_rad);

  const Building* building_;
  Renderer renderer_;
  double camera_height_m_;
  RobotOptions options_;
  ServoOptions servo_options_;
  uint64_t seed_;
  uint64_t num_draws_ = 0;  // images, noise and slips so far
  PlanarPose pose_;
  PlanarMotion motion_;                    // of the last command, as it moved
  std::optional<PlanarPose> last_target_;  // place of the image that it was last put at
};

}  // namespace cairn::sim
