#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/error.h"
#include "core/ids.h"

namespace cairn {

// COLMAP's camera models (src/base/camera_models.h of COLMAP 3.8) and their numbers in its database.
enum class CameraModel : int {
  kSimplePinhole = 0,  // f, cx, cy
  kPinhole = 1,        // fx, fy, cx, cy
  kSimpleRadial = 2,   // f, cx, cy, k
  kRadial = 3,         // f, cx, cy, k1, k2
  kOpenCv = 4,         // fx, fy, cx, cy, k1, k2, p1, p2
  kOpenCvFisheye = 5,  // fx, fy, cx, cy, k1, k2, k3, k4
  kFullOpenCv = 6,     // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
};

const char* CameraModelName(CameraModel model);
// Errors: Unsupported for a name or number that is none of the above; lists the known ones.
Result<CameraModel> CameraModelFromName(std::string_view name);
Result<CameraModel> CameraModelFromId(int id);
int NumCameraParams(CameraModel model);

// Intrinsics.  Pixels in COLMAP's convention: the centre of the first pixel is (0.5, 0.5).
struct Camera {
  CameraId camera_id = 1;
  CameraModel model = CameraModel::kSimplePinhole;
  int width = 0;   // px
  int height = 0;  // px
  std::vector<double> params;
  // False when the focal length is a guess (f = 1.2 max(w, h)).
  bool has_focal_prior = true;

  double FocalX() const { return params[0]; }
  double FocalY() const;
  double MeanFocal() const { return 0.5 * (FocalX() + FocalY()); }
  Eigen::Vector2d PrincipalPoint() const;
};

// Errors: InvalidArgument for a wrong number of parameters, a size or focal length that is not positive, NaN.
Status CheckCamera(const Camera& camera);

// A pinhole camera that nobody calibrated: f = 1.2 max(w, h), principal point in the middle, has_focal_prior
// false.
Camera GuessCamera(CameraId camera_id, int width, int height);

// Pixel at which a point of the camera frame is seen; nothing when it lies behind the camera (z <= 0).
std::optional<Eigen::Vector2d> ImageFromCamera(const Camera& camera, const Eigen::Vector3d& point_in_cam);

// Normalised coordinates (x/z, y/z) of the ray through a pixel: distortion is inverted by Gauss-Newton to
// 1e-10. Nothing when the iteration does not converge or the ray does not point forward.
std::optional<Eigen::Vector2d> CameraFromImage(const Camera& camera, const Eigen::Vector2d& pixel);

}  // namespace cairn
