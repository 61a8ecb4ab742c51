#pragma once

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "pipeline/exchange/bags/messages.h"

namespace cairn::pipeline {

// Camera 1 from what a camera_info states, in COLMAP's pixels: half a pixel is added to the principal point,
// which ROS counts as OpenCV does.
//
//   distortion_model                  D                              camera
//   any                               none, or zeros                 PINHOLE
//   plumb_bob                         k1 k2 p1 p2, k3 = 0            OPENCV
//   plumb_bob                         k1 k2 p1 p2 k3                 FULL_OPENCV
//   rational_polynomial               k1 k2 p1 p2 k3 k4 k5 k6, 0...  FULL_OPENCV
//   equidistant, fisheye, kannala_brandt4  k1 k2 k3 k4               OPENCV_FISHEYE
//
// `is_rectified`: of images without distortion, whose intrinsics are P's.  Part of the sensor and binning are
// taken into account.  Errors: NoData (not calibrated: no focal length), Unsupported (another model; thin
// prisms or a tilted sensor), InvalidArgument (as CheckCamera); without the topic's name.
Result<Camera> CameraOfInfo(const CameraInfoMessage& camera_info, bool is_rectified);

}  // namespace cairn::pipeline
