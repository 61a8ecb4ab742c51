#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "core/geometry/pose.h"

namespace cairn {

// A camera of a rig, as COLMAP (3.12 and later) has it in rig_config.json: those of its images that were
// taken at one time have the same name but for the prefix.
struct RigCamera {
  std::string image_prefix;  // "left/"
  Pose cam_from_rig;
  // Model and parameters, without the size of its images; none: the file has none.
  std::optional<Camera> camera;
};

inline constexpr const char* kRigConfigFile = "rig_config.json";

// The rig in a rig_config.json: the reference sensor's camera first, the others in the file's order.  Errors:
// those of ReadFile; Corrupt, naming the file and what was expected; Unsupported (a camera model; several
// rigs).
Result<std::vector<RigCamera>> ReadRigConfig(const std::string& path);
// The first camera is the reference sensor.
std::string RigConfigJson(const std::vector<RigCamera>& cameras);

// What a camera of the rig calls an image that the first one calls `name`, which may have folders before the
// prefix.  Errors: InvalidArgument where the name has not the first one's prefix.
Result<std::string> NameInRig(const std::vector<RigCamera>& rig, size_t camera, const std::string& name);

}  // namespace cairn
