#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "core/geometry/pose.h"
#include "stages/reconstruct/inertial/inertial_alignment.h"

namespace cairn::reconstruct {

// How far an image is from where the IMU has it.
struct InertialResidual {
  std::string name;
  double residual_m = 0;
  bool is_off = false;
};

// What the IMUs of a capture say of its reconstruction.
struct InertialScale {
  std::string told_by;     // the files
  double scale = 0;        // metres per unit of the model
  double sigma_ratio = 0;  // its standard deviation, as a part of it; infinite: the motion does not show it
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // of length 1, model
  double up_sigma_deg = 0;
  std::vector<InertialResidual> residuals;
  std::vector<std::string> warnings;
};

// Whether a capture has an IMU: ROOT/imu.csv, or ROOT/imu/SESSION.csv of one that was joined from others.
bool HasImu(const Capture& capture);

// Scale and vertical by all IMUs of a capture, each with the images of its session whose names are times
// (image_times.h), of the folder that has most: an IMU is on one camera.  Several are weighted by their
// standard deviations.  `model`: cam_from_model by image name.
// Errors: those of ReadImu but NoData, which leaves the question to the other IMUs; NoData, with the files,
// where none of them says anything (ReadImu, AlignToImu).
Result<InertialScale> ScaleByImu(const Capture& capture, const std::map<std::string, Pose>& model,
                                 const InertialOptions& options);

}  // namespace cairn::reconstruct
