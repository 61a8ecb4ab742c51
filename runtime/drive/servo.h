#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "core/options/options.h"
#include "runtime/drive/planar_epipoles.h"

namespace cairn {

// Steers a robot with wheels and a forward camera to where an image was taken, by pixels matched between that
// image and what the robot sees: no map, no depths, no odometry, and a focal length that may be wrong
// by a fifth.
//
// Mariottini, Oriolo, Prattichizzo, "Image-Based Visual Servoing for Nonholonomic Mobile Robots Using
// Epipolar Geometry", IEEE T-RO 23(1), 2007, as [Mariottini11 §V-A] uses it: step 1 brings both epipoles to
// zero, step 2 moves along the target's axis until the features coincide.  Differs from it: the epipoles come
// from planar motion (planar_epipoles.h), so that a wall and its floor are enough and the epipoles stay
// accurate near the target; both epipoles are kept small by the heading instead of by inverting the motion,
// which is singular where they vanish; field of view is kept by bounding the turn from the target's heading.
//
// With the angles of planar_epipoles.h, v the speed and w the turn rate (left positive) of a unicycle:
//
//   rho' = -v cos(psi)      psi' = (v / rho) sin(psi) - w      phi' = (v / rho) sin(psi)
//
// Approach: delta = phi + pi is the way to the target in its frame.  With the heading turned by gain * delta,
// delta' is -(gain - 1) (v / rho) delta to first order: both epipoles vanish, at any scale.  In front of the
// target it reverses likewise, with -phi for delta.  That needs |gain * delta| within the turn allowed: a
// robot beside the target first retreats, reversing with its heading turned by max_heading_deg towards the
// axis, until it stands in one of those cones; where the scene gets too small, it goes forwards to the height
// of the target with the opposite turn and retreats again.  Something that stops the robot ends the leg: from
// there it goes the other way.  The focal length that matches show is remembered from image to image.  Only
// the speed depends on a scale: the scene's distance is learnt from the way that the robot's commands should
// have covered, beginning with scene_distance_m.
//
// All of that is about the middle of the robot's axle, which is where it turns about, on the way to where it
// was when the camera took the target's image.  With M the camera on the robot and T the camera in the
// target's camera (both over the floor, in units of the scene's distance), it stands at M T M^-1.
struct ServoOptions {
  // Greatest speed, m/s, and turn rate, degrees/s.  REQUIRES: > 0
  double max_speed_m_s = 0.5;
  double max_turn_deg_s = 60;
  // Time for which a command holds, seconds.  REQUIRES: > 0
  double step_s = 0.25;
  // Part of the remaining way, and of the wanted turn, that is covered in a second.  REQUIRES: in (0, 10]
  double speed_gain = 1.5;
  double turn_gain = 2.5;
  // Heading over the direction to the target while it approaches.  REQUIRES: in [1.5, 10]
  double approach_gain = 3;
  // Greatest turn from the target's heading that is made on purpose, degrees.  REQUIRES: in [5, 60]
  double max_heading_deg = 28;
  // Turns on the spot when the heading is off by more, degrees.  REQUIRES: in [1, 90]
  double max_heading_error_deg = 12;
  // Arrived: largest turn from the target's heading, degrees, and largest distance over that of the
  // scene.  REQUIRES: > 0
  double arrive_heading_deg = 0.5;
  double arrive_distance_ratio = 0.007;
  // Both double every time this many commands were given near the target: with matches too poor for them the
  // robot would move to and fro for ever.  REQUIRES: > 0
  int patience_commands = 100;
  // A retreat ends at this distance behind the target, over that of the scene.  REQUIRES: in (0, 10]
  double max_retreat_ratio = 0.6;
  // With fewer matches than this the robot looks along the target's heading, the fewer the straighter.
  // REQUIRES: >= 4
  int min_num_matches_to_turn = 40;
  // Distance of the scene before anything is known, metres: too small is slow, too large may
  // overshoot.  REQUIRES: > 0
  double scene_distance_m = 1;
  // Where the camera is on the robot: ahead and to the left of the middle of its axle, metres, turned to the
  // left, degrees.  REQUIRES: in [-2, 2], in [-45, 45]
  double camera_ahead_m = 0;
  double camera_left_m = 0;
  double camera_turn_deg = 0;
  PlanarEpipolesOptions epipoles;
};
OptionTable DescribeOptions(ServoOptions* options);

// COLMAP's convention, as core/camera/camera.h.
struct PixelPair {
  Eigen::Vector2d current_px, target_px;
};

enum class ServoState { kTurning, kApproaching, kArrived, kLost };
// "turning", "approaching", "arrived", "lost".
const char* ServoStateName(ServoState state);

struct ServoCommand {
  double speed_m_s = 0;   // negative: backwards
  double turn_rad_s = 0;  // left positive
  ServoState state = ServoState::kLost;
  int num_matches = 0;                     // that were given
  std::string why;                         // a sentence
  std::optional<PlanarEpipoles> epipoles;  // none when lost
};

// Change of distance (m/s), of the target's bearing and of the bearing from the target (rad/s).
struct PolarRates {
  double rho_m_s = 0, psi_rad_s = 0, phi_rad_s = 0;
};
PolarRates RatesOf(double rho_m, double psi_rad, double speed_m_s, double turn_rad_s);

// One leg: made for a target image, then asked at each image.
class Servo {
 public:
  // Errors: InvalidArgument (options, camera).
  static Result<Servo> Create(const Camera& assumed_camera, const ServoOptions& options);

  // Stops with kLost, and may go on with the next image, when the matches determine no motion: too few, too
  // few that agree, in one spot, not finite.  Deterministic.
  ServoCommand Step(const std::vector<PixelPair>& pairs);

  // Tells the servo that the last command did not move the robot: something stands in the way.
  void Blocked();

  // Distance of the scene as learnt so far, metres.
  double scene_distance_m() const { return way_m_ / way_ratio_; }

 private:
  Servo(const Camera& camera, const ServoOptions& options);
  // The middle of the axle in the target's frame, over the scene's distance.
  PlanarPose AxleInTarget(const PlanarEpipoles& epipoles) const;
  bool IsCameraOnAxle() const;
  void LearnFocal(const PlanarEpipoles& epipoles);
  void LearnScale(const PlanarPose& pose);
  void ChooseLeg(const PlanarPose& pose);
  double WantedHeading(const PlanarPose& pose, int num_inliers) const;
  double Patience() const;

  Camera camera_;
  ServoOptions options_;
  enum class Leg { kApproach, kRetreat, kToHeightOfTarget } leg_ = Leg::kApproach;
  // For the last two legs: the side of the axis on which they began, 1 left, -1 right.  They keep it, even
  // where the side is uncertain near the target.
  double leg_side_ = 1;
  // Where something stopped the robot, in the target's frame over the scene's distance; the leg that followed
  // goes on until it is away from there.
  std::optional<Eigen::Vector2d> blocked_at_;
  std::optional<PlanarEpipoles> last_;
  double last_speed_m_s_ = 0;
  int num_commands_ = 0;              // since it first came near the target
  double way_m_ = 0, way_ratio_ = 0;  // scene distance = first / second
};

}  // namespace cairn
