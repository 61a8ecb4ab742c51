#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/base/pooled.h"

namespace cairn {

// COLMAP's camera models (src/base/camera_models.h of COLMAP 3.8) and their numbers in its database; and one
// of ours, which no database holds.  Perspective models distort (x/z, y/z); FOV and fisheye models distort
// the angle between ray and axis, which may exceed 90 degrees.
enum class CameraModel : int {
  kSimplePinhole = 0,        // f, cx, cy
  kPinhole = 1,              // fx, fy, cx, cy
  kSimpleRadial = 2,         // f, cx, cy, k
  kRadial = 3,               // f, cx, cy, k1, k2
  kOpenCv = 4,               // fx, fy, cx, cy, k1, k2, p1, p2
  kOpenCvFisheye = 5,        // fx, fy, cx, cy, k1, k2, k3, k4
  kFullOpenCv = 6,           // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
  kFov = 7,                  // fx, fy, cx, cy, omega
  kSimpleRadialFisheye = 8,  // f, cx, cy, k
  kRadialFisheye = 9,        // f, cx, cy, k1, k2
  kThinPrismFisheye = 10,    // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1
  kEquirectangular = 1000,   // no parameters: longitude from -180 degrees at the left edge, latitude from
                             // -90 (up, -y of the camera) at the top edge; +z is the middle of the image
};

const char* CameraModelName(CameraModel model);
// Errors: Unsupported for a name or number that is none of the above; lists the known ones.
Result<CameraModel> CameraModelFromName(std::string_view name);
// Only COLMAP's: 0 to 10.
Result<CameraModel> CameraModelFromId(int id);
int NumCameraParams(CameraModel model);

// Intrinsics.  Pixels in COLMAP's convention: the centre of the first pixel is (0.5, 0.5).
struct Camera {
  CameraId camera_id = 1;
  CameraModel model = CameraModel::kSimplePinhole;
  int width = 0;   // px
  int height = 0;  // px
  PooledVector<double> params;
  // False when the focal length is a guess (f = 1.2 max(w, h)).
  bool has_focal_prior = true;

  // px; of a panorama: pixels per radian on the horizon.
  double FocalX() const;
  double FocalY() const;
  double MeanFocal() const { return 0.5 * (FocalX() + FocalY()); }
  Eigen::Vector2d PrincipalPoint() const;
};

// Errors: InvalidArgument for a wrong number of parameters, a size or focal length that is not positive, NaN.
Status CheckCamera(const Camera& camera);

// COLMAP's words MODEL WIDTH HEIGHT PARAMS... from words[first] on; camera_id is left at 1.  Errors: Corrupt
// (not such words), Unsupported (model), those of CheckCamera.
Result<Camera> CameraFromWords(const std::vector<std::string>& words, size_t first);

// A pinhole camera that nobody calibrated: f = 1.2 max(w, h), principal point in the middle,
// has_focal_prior false.
Camera GuessCamera(CameraId camera_id, int width, int height);

// Pixel at which a point of the camera frame is seen, inside the image or not.  Nothing when the model does
// not see it: behind a perspective camera (z <= 0), on the back half of a fisheye's axis, or beyond the
// radius at which the distortion polynomial folds back into the image.  Inverse of BearingFromImage.
std::optional<Eigen::Vector2d> ImageFromCamera(const Camera& camera, const Eigen::Vector3d& point_in_cam);

// Direction, a unit vector of the camera frame, of the ray through a pixel; beyond 90 degrees off the axis
// too for FOV, fisheye and equirectangular models.  Distortion is inverted to 1e-12 of the normalised
// coordinates.  Nothing when no ray before the distortion's fold meets the pixel.
std::optional<Eigen::Vector3d> BearingFromImage(const Camera& camera, const Eigen::Vector2d& pixel);

// The same ray as normalised coordinates (x/z, y/z).  Nothing also when it lies more than 86 degrees (1.5
// rad) off the axis of a camera that is not perspective: use bearings for those.
std::optional<Eigen::Vector2d> CameraFromImage(const Camera& camera, const Eigen::Vector2d& pixel);

}  // namespace cairn
