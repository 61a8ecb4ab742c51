#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

// The node's interface to the runtime, in C++17: ROS 1's messages do not compile as C++20, and the runtime's
// headers need C++20.
namespace cairn_ros {

// The node's parameters, by their names.
struct Parameters {
  std::string map;              // path
  int memory_budget_mib = 256;  // limit for loaded parts of the map that are kept
  std::string public_key;       // file of `cairn keygen`; maps that this key has not signed are refused
  bool follow = true;           // from frame to frame; false: every image as if it were the first
  // Where the camera's optical frame is mounted on the robot: x y z (m), qx qy qz qw; empty: the pose is
  // the camera's.
  std::vector<double> camera_in_robot;
  std::string camera_model;  // COLMAP's name; empty: the map's camera of the image's size
  std::vector<double> camera_params;
  std::string log;  // folder of a log (docs/robots.md); empty: none
  double log_max_mb_per_day = 50;
};

struct Image {
  std::string encoding;
  uint32_t width = 0, height = 0, step = 0;
  const uint8_t* bytes = nullptr;
  size_t num_bytes = 0;
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
  double probability = 0;  // that the fix is right
  double library_ms = 0;   // in the runtime: the rest is the node's
};

// Where a survey image was taken: the robot's base there, or the camera without a mounting.
struct SurveyPose {
  std::string image;
  double position[3] = {0, 0, 0};
  double orientation_xyzw[4] = {0, 0, 0, 1};
};

// Where a robot may have started.
struct Starts {
  std::string error;    // why the last goal, report or image was not taken; empty: it was
  std::string verdict;  // "follow", "switch" or "lost"; empty before the first image
  struct Start {
    SurveyPose pose;
    double posterior = 0;
  };
  std::vector<Start> starts;
  int followed = -1;
  std::vector<SurveyPose> way;  // from the followed start to the goal
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
