#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

// The node's interface to the runtime, in C++17: ROS 1's messages do not compile as C++20, and the runtime's
// headers need C++20.
namespace cairn_ros {

// The node's parameters, by their names.
struct Parameters {
  std::string map;              // path
  int memory_budget_mib = 256;  // limit for loaded parts of the map that are kept
  std::string public_key;  // file of `cairn keygen` or `cairn keys`: maps that it does not trust are refused
  bool follow = true;      // from frame to frame; false: every image as if it were the first
  // Where the camera's optical frame is mounted on the robot: x y z (m), qx qy qz qw; empty: the pose is
  // the camera's.
  std::vector<double> camera_in_robot;
  // What the topic imu says of up counts; how the IMU is mounted on the robot: as camera_in_robot; empty: as
  // the robot's own axes.
  bool gravity = false;
  double gravity_sigma_deg = 2;
  std::vector<double> imu_in_robot;
  // Most work for an image (LocalizerOptions), ms of a core that is core_speed times as fast as the one on
  // which it was measured; 0: any.
  double budget_ms = 0;
  double core_speed = 1;
  std::string camera_model;  // COLMAP's name; empty: the map's camera of the image's size
  std::vector<double> camera_params;
  std::string log;  // folder of a log (docs/robots.md); empty: none
  double log_max_mb_per_day = 50;
  // On its way to a goal the robot is steered (steerer.h): at most so fast, a command every step_s.
  bool steer = false;
  double step_s = 0.25;
  double max_speed_m_s = 0.5;
  double max_turn_deg_s = 60;
  double stop_after_s = 1;  // without an image it drives no longer
  // Which places the robot may be at is kept in mind (whereabouts.h), by an image every so many seconds.
  bool where = false;
  double where_period_s = 1;
  double min_place_probability = 0;  // with `where`: of a fix's place, by all images so far; 0: every fix
  // In a map with a floor plan the robot is looked for on it by its laser (plan_follower.h).
  bool plan = true;
  std::vector<double> laser_in_robot;  // as camera_in_robot; empty: at the middle of the axle, looking ahead
  double laser_max_range_m = 20;       // beams of more met nothing
  double min_plan_probability = 0.9;   // of a place that is published as the robot's
};

struct Image {
  std::string encoding;
  uint32_t width = 0, height = 0, step = 0;
  const uint8_t* bytes = nullptr;
  size_t num_bytes = 0;
  double stamp_s = 0;  // when it was taken; 0: now
};

// Where a survey image was taken: the robot's base there, or the camera without a mounting.
struct SurveyPose {
  std::string image;
  double position[3] = {0, 0, 0};
  double orientation_xyzw[4] = {0, 0, 0, 1};
};

// Where a robot may be, after an image.
struct Places {
  std::string error;  // why the image did not count; empty: it did
  struct Place {
    SurveyPose pose;
    double probability = 0;
  };
  std::vector<Place> places;  // the likeliest first; with `elsewhere` they sum to 1
  double elsewhere = 0;       // P(at no place of the map)
};

// One turn of a laser, with the fields of sensor_msgs/LaserScan.
struct LaserScan {
  double stamp_s = 0;  // 0: now
  double first_angle_rad = 0, step_rad = 0;
  double range_min_m = 0, range_max_m = 0;
  const float* ranges_m = nullptr;
  size_t num_ranges = 0;
};

// Where a robot may be on its map's floor plan.
struct PlanPlaces {
  std::string error;   // why the scan or image could not be tried; empty: it could
  std::string reason;  // why it said nothing; empty: it did
  struct Place {
    double position[3] = {0, 0, 0};  // of the robot's base on the floor, in the map's frame
    double orientation_xyzw[4] = {0, 0, 0, 1};
    double covariance[36] = {0};  // as Answer's; no height, roll or pitch
    double probability = 0;
    bool is_determined = false;  // false: along some direction the place is not known, as in a corridor
  };
  std::vector<Place> places;  // the most probable first; those of a probability below 0.001 are left out
  double elsewhere = 1;       // P(anywhere else)
};

struct Answer {
  bool is_error = false;  // the image could not be tried
  bool has_fix = false;
  std::string reason;   // "none" with a fix, why there is none, or the error's name
  std::string message;  // empty with a fix
  double position[3] = {0, 0, 0};
  double orientation_xyzw[4] = {0, 0, 0, 1};
  double covariance[36] = {0};  // x, y, z, rotation about the map's x, y, z
  int num_features = 0, num_inliers = 0, region = -1;
  std::string scope;                      // among which landmarks it was found
  double probability = 0;                 // that the fix is right
  double work_ms = 0;                     // what the answer took, as budget_ms is counted
  double library_ms = 0;                  // in the runtime: the rest is the node's
  std::optional<Places> places;           // of an image by which whereabouts were looked for
  std::optional<PlanPlaces> plan_places;  // of one that counted on the floor plan
};

// Where a robot may have started.
struct Starts {
  std::string error;    // why the last goal, report or image was not taken; empty: it was
  std::string verdict;  // "follow", "switch", "lost" or "goal"; empty before the first image
  struct Start {
    SurveyPose pose;
    double posterior = 0;
  };
  std::vector<Start> starts;
  int followed = -1;
  std::vector<SurveyPose> way;  // from the followed start to the goal
  std::string next;             // the survey image that the robot goes to next; empty: none
};

// How a robot is to drive until the next image.
struct Steered {
  std::string error;      // why the image could not be tried: the robot stands
  double speed_m_s = 0;   // ahead
  double turn_rad_s = 0;  // to the left
  std::string state;      // "turning", "approaching", "arrived" (at the goal) or "lost": it stands
  std::string why;        // a sentence
  int num_matches = 0;
  std::vector<Starts> arrivals;  // what was known after each image that it passed
};

class MapLocalizer {
 public:
  // Null on failure; `code` and `message` then say why.
  static std::unique_ptr<MapLocalizer> Open(const Parameters& parameters, int* code, std::string* message);
  ~MapLocalizer();

  Answer Locate(const Image& image);

  // For a robot that does not know where it starts, on its way to a survey image (start_finder.h).
  Starts SetGoal(const std::string& image);
  Starts Report(const std::string& word);
  bool IsLooking() const;  // whether the next image is to go to Look
  Starts Look(const Image& image);
  // Whether the next image is to go to Steer: with a goal, the way to it known, and Parameters::steer.
  bool IsSteering() const;
  // Passes as many images of the way as it has arrived at.
  Steered Steer(const Image& image);

  // Where odometry has the robot: metres, radians to the left, in a frame of its own.  False: not finite.
  bool AddOdometry(double stamp_s, double x_m, double y_m, double heading_rad);

  // Whether the robot is looked for on a floor plan: Parameters::plan, and the map has one.
  bool IsOnPlan() const;
  // Where it may be after a scan.  None: without odometry, not every scan counts.
  std::optional<PlanPlaces> Scan(const LaserScan& scan);

  // Which way is up in an IMU's frame, by its attitude or by its acceleration, which is up where the robot
  // does not speed up: by 1 m/s^2 it errs by 6 degrees, and is taken for no better.  False: no direction, or
  // not finite.
  bool AddUp(double stamp_s, double x, double y, double z, bool is_acceleration);

  std::string map_name() const;
  int64_t num_landmarks() const;
  int64_t num_kept_bytes() const;  // of the map, in memory
  int64_t num_logged() const;      // frames
  std::string log_error() const;   // why the log can no longer be written; empty: it can

 private:
  struct State;
  explicit MapLocalizer(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace cairn_ros
