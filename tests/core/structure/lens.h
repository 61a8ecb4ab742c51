#pragma once

#include "core/camera/camera.h"

namespace cairn {

// A camera with a distortion of every kind that OpenCV's model has.
inline Camera Lens() {
  Camera camera;
  camera.model = CameraModel::kOpenCv;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 510, 322, 238, -0.1, 0.03, 0.002, -0.001};
  return camera;
}

}  // namespace cairn
