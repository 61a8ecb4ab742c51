#pragma once

#include <map>
#include <string>

#include "core/base/error.h"
#include "core/camera/camera.h"

namespace cairn {

// A list in COLMAP's cameras.txt form: CAMERA_ID MODEL WIDTH HEIGHT PARAMS... on each line.
// Errors: those of ReadFile, Corrupt (with file and line), Unsupported (camera model), NoData (no camera).
Result<std::map<CameraId, Camera>> ReadCamerasText(const std::string& path);
Status WriteCamerasText(const std::string& path, const std::map<CameraId, Camera>& cameras);

// One camera as "MODEL,W,H,P1,P2,..." (the form of --camera).
Result<Camera> ParseCamera(const std::string& text);

}  // namespace cairn
