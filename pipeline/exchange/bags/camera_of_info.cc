#include "pipeline/exchange/bags/camera_of_info.h"

#include <algorithm>

#include "core/base/pooled.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

struct Intrinsics {
  double fx, fy, cx, cy;
};

// `count` values; those that are not stated are zero.
std::vector<double> Padded(std::vector<double> d, size_t count) {
  d.resize(std::max(d.size(), count));
  return d;
}

bool AreZero(const std::vector<double>& d, size_t first) {
  return std::all_of(d.begin() + std::min(first, d.size()), d.end(), [](double value) { return value == 0; });
}

Result<Camera> Distorted(const CameraInfoMessage& camera_info, const Intrinsics& k, int width, int height) {
  const std::string& name = camera_info.distortion_model;
  const auto make = [&](CameraModel model, std::initializer_list<double> distortion) {
    PooledVector<double> params = {k.fx, k.fy, k.cx, k.cy};
    params.insert(params.end(), distortion.begin(), distortion.end());
    return CameraFromOpenCv(1, model, width, height, std::move(params));
  };
  if (AreZero(camera_info.d, 0)) return make(CameraModel::kPinhole, {});
  const std::vector<double> d = Padded(camera_info.d, 8);
  if (name == "plumb_bob" || name == "rational_polynomial") {
    if (!AreZero(d, 8)) {
      return MakeError(ErrorCode::kUnsupported,
                       "its distortion has thin prisms or a tilted sensor ({} parameters), which no model of "
                       "ours has; calibrate it as plumb_bob or rational_polynomial of 8",
                       d.size());
    }
    if (AreZero(d, 4)) return make(CameraModel::kOpenCv, {d[0], d[1], d[2], d[3]});
    return make(CameraModel::kFullOpenCv, {d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7]});
  }
  if ((name == "equidistant" || name == "fisheye" || name == "kannala_brandt4") && AreZero(d, 4))
    return make(CameraModel::kOpenCvFisheye, {d[0], d[1], d[2], d[3]});
  return MakeError(
      ErrorCode::kUnsupported,
      "its distortion model is '{}' with {} parameters; known are plumb_bob, rational_polynomial, "
      "equidistant and fisheye",
      name, camera_info.d.size());
}

}  // namespace

Result<Camera> CameraOfInfo(const CameraInfoMessage& camera_info, bool is_rectified) {
  const auto& p = camera_info.p;
  const auto& matrix = camera_info.k;
  Intrinsics k = is_rectified ? Intrinsics{p[0], p[5], p[2], p[6]}
                              : Intrinsics{matrix[0], matrix[4], matrix[2], matrix[5]};
  if (k.fx == 0 || k.fy == 0) {
    return MakeError(ErrorCode::kNoData, "it states no focal length in {}: the camera is not calibrated",
                     is_rectified ? "P" : "K");
  }
  const double binning_x = std::max(1u, camera_info.binning_x);
  const double binning_y = std::max(1u, camera_info.binning_y);
  // A binned pixel's centre is that of the pixels in it: -0.5 here, which becomes the corner again.
  k = {k.fx / binning_x, k.fy / binning_y, (k.cx + 0.5 - camera_info.roi_x) / binning_x - 0.5,
       (k.cy + 0.5 - camera_info.roi_y) / binning_y - 0.5};
  const uint32_t width = camera_info.roi_width > 0 ? camera_info.roi_width : camera_info.width;
  const uint32_t height = camera_info.roi_height > 0 ? camera_info.roi_height : camera_info.height;
  const int binned_width = static_cast<int>(std::min(1e9, width / binning_x));
  const int binned_height = static_cast<int>(std::min(1e9, height / binning_y));
  Camera camera;
  if (is_rectified) {
    camera =
        CameraFromOpenCv(1, CameraModel::kPinhole, binned_width, binned_height, {k.fx, k.fy, k.cx, k.cy});
  } else {
    CAIRN_ASSIGN_OR_RETURN(camera, Distorted(camera_info, k, binned_width, binned_height));
  }
  CAIRN_RETURN_IF_ERROR(CheckCamera(camera));
  return camera;
}

}  // namespace cairn::pipeline
