#pragma once

#include <vector>

#include "core/camera/camera.h"

namespace cairn::reconstruct {

struct MapGloballyOptions {
  // Whether the cameras' focal lengths and distortion, which come from EXIF or a guess, are refined.  One
  // radial parameter for cameras that are given without any.
  bool refine_focal_length = true;
  bool refine_distortion = true;
};

// A camera's parameters that an adjustment may change, and by how much they are likely to.
struct FreeCamera {
  Camera camera;              // refined
  Camera stated;              // what the deviations are about
  std::vector<int> free;      // indices of parameters, ascending
  std::vector<double> sigma;  // per free one
};

// Those that the options say; of a panorama none.
FreeCamera FreeOf(const Camera& stated, const MapGloballyOptions& options);

}  // namespace cairn::reconstruct
