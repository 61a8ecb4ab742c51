#pragma once

#include <string>
#include <vector>

#include "core/camera/camera.h"
#include "core/options/options.h"

namespace cairn::group_classes {

struct CameraPriorOptions {
  // Standard deviations of what a survey states of a camera without distortion, which may be a data sheet's
  // or a guess: focal length as a part of itself, principal point as a part of the image's width, distortion
  // coefficients.  REQUIRES: > 0
  double focal_sigma_ratio = 0.03;
  double principal_point_sigma_ratio = 0.015;
  double distortion_sigma = 0.1;
  // Standard deviation of the ratio of the two focal lengths: pixels are made square, or as stated.
  double aspect_sigma_ratio = 0.003;
  // All of these are so many times smaller for a camera that is stated with distortion, which only a
  // calibration finds.  REQUIRES: >= 1
  double calibrated_ratio = 10;
};
OptionTable DescribeOptions(CameraPriorOptions* options);

// A way in which a camera may differ from what is stated: its model and which of its parameters change.
struct CameraVariant {
  std::string name;             // "k1", "f", ...; empty: as stated
  Camera camera;                // as stated, in the variant's model
  std::vector<int> free;        // indices of parameters, ascending
  std::vector<double> sigma;    // of each
  double difference_sigma = 0;  // of the two focal lengths' difference, px; 0: they are not both free
};

// From as stated (the first) to all that a lens of its kind may need, fewest parameters first.
std::vector<CameraVariant> CameraVariants(const Camera& stated, const CameraPriorOptions& options);

}  // namespace cairn::group_classes
