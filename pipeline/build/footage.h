#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/pose.h"

namespace cairn::pipeline {

// What a [[capture]] of a recipe names.  Films and bags are footage: it is imported into the build folder
// first (`cairn import`).
enum class CaptureKind {
  kFolder,  // of images
  kFilm,
  kBag,  // of ROS: a file, or a folder of such files, without images beside them
};

// A file that is no bag is a film, or the import says what it is instead.
CaptureKind KindOfCapture(const std::string& path);

// How footage is imported, as the options of `cairn import` of the same names say it.  Empty: the option is
// not given.
struct FootageOptions {
  std::string keyframes = "auto";
  std::string camera;
  // Of bags alone.
  std::string topic, odometry, camera_on_robot, imu, imu_on_camera, max_time_gap_s;
};

// A key of a [[capture]] that is for footage.
struct FootageKey {
  const char* name;
  const char* type;
  const char* help;  // for the reference page
  bool is_for_films;
  std::string FootageOptions::*option;
};

// In the order of the reference page.
const std::vector<FootageKey>& FootageKeys();

// Sets one of them from its text; lists are joined by commas.  Errors: InvalidArgument for a value that the
// import would not take, or that make or a shell would not read as it is; Corrupt (a camera).
Status SetFootageOption(const FootageKey& key, const std::string& text, FootageOptions* options);

// Errors: InvalidArgument where a key is for another kind of capture.
Status CheckIsFor(const FootageKey& key, CaptureKind kind, const std::string& path);

// Where a camera's optical frame is on the robot, of seven numbers: x, y, z, metres, and the quaternion qx,
// qy, qz, qw.  REQUIRES: seven.  Errors: those of NormalizePose.
Result<Pose> CameraOnRobot(const std::vector<double>& numbers);

// The options as words of a command line.
std::vector<std::string> FootageWords(CaptureKind kind, const FootageOptions& options);

}  // namespace cairn::pipeline
