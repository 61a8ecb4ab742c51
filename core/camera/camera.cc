#include "core/camera/camera.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "core/base/text.h"
#include "core/camera/distortion.h"

namespace cairn {
namespace {

// What a model's image plane shows before distortion.
enum class Projection { kPerspective, kAngle, kFov, kEquirectangular };

struct ModelRow {
  CameraModel model;
  const char* name;
  int num_params;
  int num_focals;  // 1: f shared by both axes, 2: fx, fy
  Projection projection;
};

constexpr std::array<ModelRow, 12> kModels = {{
    {CameraModel::kSimplePinhole, "SIMPLE_PINHOLE", 3, 1, Projection::kPerspective},
    {CameraModel::kPinhole, "PINHOLE", 4, 2, Projection::kPerspective},
    {CameraModel::kSimpleRadial, "SIMPLE_RADIAL", 4, 1, Projection::kPerspective},
    {CameraModel::kRadial, "RADIAL", 5, 1, Projection::kPerspective},
    {CameraModel::kOpenCv, "OPENCV", 8, 2, Projection::kPerspective},
    {CameraModel::kOpenCvFisheye, "OPENCV_FISHEYE", 8, 2, Projection::kAngle},
    {CameraModel::kFullOpenCv, "FULL_OPENCV", 12, 2, Projection::kPerspective},
    {CameraModel::kFov, "FOV", 5, 2, Projection::kFov},
    {CameraModel::kSimpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", 4, 1, Projection::kAngle},
    {CameraModel::kRadialFisheye, "RADIAL_FISHEYE", 5, 1, Projection::kAngle},
    {CameraModel::kThinPrismFisheye, "THIN_PRISM_FISHEYE", 12, 2, Projection::kAngle},
    {CameraModel::kEquirectangular, "EQUIRECTANGULAR", 0, 0, Projection::kEquirectangular},
}};

// Largest angle off the axis that is expressed as (x/z, y/z), rad.
constexpr double kMaxForwardAngle = 1.5;
// Largest tangent of the angle off the axis of a perspective camera.
constexpr double kMaxTangent = 1e3;

const ModelRow& RowOf(CameraModel model) {
  return model == CameraModel::kEquirectangular ? kModels.back() : kModels[static_cast<int>(model)];
}

std::string KnownModels() {
  std::string names;
  for (const ModelRow& row : kModels) names += (names.empty() ? "" : ", ") + std::string(row.name);
  return names;
}

// [Devernay & Faugeras 2001]: the image radius is atan(2 tan(omega/2) tan(angle)) / omega, here for angles up
// to 180 degrees; for omega = 0 a perspective camera.
struct FieldOfViewLaw {
  double omega;
  double twice_tangent;

  explicit FieldOfViewLaw(const Camera& camera)
      : omega(std::abs(camera.params[4])), twice_tangent(2 * std::tan(0.5 * omega)) {}
  // Below this the law differs from perspective by less than 1e-12 of the radius.
  bool IsPerspective() const { return omega < 1e-6; }
};

// Whether the image plane shows (x/z, y/z) before distortion.
bool IsPerspective(const Camera& camera) {
  const Projection projection = RowOf(camera.model).projection;
  return projection == Projection::kPerspective ||
         (projection == Projection::kFov && FieldOfViewLaw(camera).IsPerspective());
}

bool IsUndistorted(const Camera& camera) {
  return camera.model == CameraModel::kSimplePinhole || camera.model == CameraModel::kPinhole ||
         (camera.model == CameraModel::kFov && FieldOfViewLaw(camera).IsPerspective());
}

// COLMAP's parameters in the one form that covers all of its polynomial models.
Distortion DistortionOf(const Camera& camera) {
  const double* p = camera.params.data();
  DistortionCoefficients c;
  switch (camera.model) {
    case CameraModel::kSimpleRadial:
    case CameraModel::kSimpleRadialFisheye:
      c.numerator[1] = p[3];
      break;
    case CameraModel::kRadial:
    case CameraModel::kRadialFisheye:
      c.numerator[1] = p[3], c.numerator[2] = p[4];
      break;
    case CameraModel::kOpenCv:
      c.numerator[1] = p[4], c.numerator[2] = p[5];
      c.p1 = p[6], c.p2 = p[7];
      break;
    case CameraModel::kOpenCvFisheye:
      c.numerator = {1, p[4], p[5], p[6], p[7]};
      break;
    case CameraModel::kFullOpenCv:
      c.numerator = {1, p[4], p[5], p[8], 0};
      c.denominator = {1, p[9], p[10], p[11]};
      c.p1 = p[6], c.p2 = p[7];
      break;
    case CameraModel::kThinPrismFisheye:
      c.numerator = {1, p[4], p[5], p[8], p[9]};
      c.p1 = p[6], c.p2 = p[7];
      c.sx = p[10], c.sy = p[11];
      break;
    default:
      break;
  }
  const bool is_angle = RowOf(camera.model).projection == Projection::kAngle;
  return Distortion(c, is_angle ? M_PI : kMaxTangent);
}

Eigen::Vector3d BearingFromAngle(const Eigen::Vector2d& direction_times_angle) {
  const double angle = direction_times_angle.norm();
  const double ratio = angle > 1e-9 ? std::sin(angle) / angle : 1;
  return {ratio * direction_times_angle.x(), ratio * direction_times_angle.y(), std::cos(angle)};
}

std::optional<Eigen::Vector2d> EquirectangularFromCamera(const Camera& camera, const Eigen::Vector3d& p) {
  if (!(p.squaredNorm() > 0)) return std::nullopt;
  const double longitude = std::atan2(p.x(), p.z());
  const double latitude = std::atan2(p.y(), std::hypot(p.x(), p.z()));  // down is positive
  return Eigen::Vector2d((longitude / (2 * M_PI) + 0.5) * camera.width,
                         (latitude / M_PI + 0.5) * camera.height);
}

Eigen::Vector3d BearingFromEquirectangular(const Camera& camera, const Eigen::Vector2d& pixel) {
  const double longitude = (pixel.x() / camera.width - 0.5) * 2 * M_PI;
  const double latitude = (pixel.y() / camera.height - 0.5) * M_PI;
  return {std::cos(latitude) * std::sin(longitude), std::sin(latitude),
          std::cos(latitude) * std::cos(longitude)};
}

// Distorted coordinates in units of the focal length.
std::optional<Eigen::Vector2d> DistortedFromCamera(const Camera& camera, const Eigen::Vector3d& p) {
  if (IsPerspective(camera)) {
    if (!(p.z() > 0)) return std::nullopt;
    if (IsUndistorted(camera)) return p.hnormalized();
    return DistortionOf(camera).Apply(p.hnormalized());
  }
  const double off_axis = std::hypot(p.x(), p.y());
  // Exactly behind the camera the direction off the axis is not defined.
  if (!p.allFinite() || (off_axis == 0 && !(p.z() > 0))) return std::nullopt;
  if (camera.model != CameraModel::kFov) {
    const double angle = std::atan2(off_axis, p.z());
    const double ratio = off_axis > 0 ? angle / off_axis : 1 / p.z();
    return DistortionOf(camera).Apply(ratio * p.head<2>());
  }
  const FieldOfViewLaw law(camera);
  const double radius = std::atan2(law.twice_tangent * off_axis, p.z()) / law.omega;
  const double ratio = off_axis > 0 ? radius / off_axis : law.twice_tangent / (law.omega * p.z());
  return ratio * p.head<2>();
}

// Inverse of DistortedFromCamera up to length: (x/z, y/z) of a perspective camera, else the angle off the
// axis times its direction.
std::optional<Eigen::Vector2d> UndistortedFromImage(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d c = camera.PrincipalPoint();
  const Eigen::Vector2d d((pixel.x() - c.x()) / camera.FocalX(), (pixel.y() - c.y()) / camera.FocalY());
  if (IsUndistorted(camera)) return d;
  if (camera.model != CameraModel::kFov) return DistortionOf(camera).Invert(d);
  const FieldOfViewLaw law(camera);
  const double radius = d.norm(), phi = law.omega * radius;
  if (!(phi < M_PI)) return std::nullopt;
  if (radius < 1e-12) return Eigen::Vector2d(d * (law.omega / law.twice_tangent));
  return Eigen::Vector2d(d * (std::atan2(std::sin(phi), law.twice_tangent * std::cos(phi)) / radius));
}

}  // namespace

const char* CameraModelName(CameraModel model) { return RowOf(model).name; }
int NumCameraParams(CameraModel model) { return RowOf(model).num_params; }

Result<CameraModel> CameraModelFromName(std::string_view name) {
  for (const ModelRow& row : kModels) {
    if (name == row.name) return row.model;
  }
  return MakeError(ErrorCode::kUnsupported, "unknown camera model '{}'; known are {}", name, KnownModels());
}

Result<CameraModel> CameraModelFromId(int id) {
  for (const ModelRow& row : kModels) {
    if (id == static_cast<int>(row.model) && row.model != CameraModel::kEquirectangular) return row.model;
  }
  return MakeError(ErrorCode::kUnsupported, "unknown camera model number {}; known are COLMAP's 0 to 10", id);
}

double Camera::FocalX() const {
  return model == CameraModel::kEquirectangular ? width / (2 * M_PI) : params[0];
}

double Camera::FocalY() const {
  if (model == CameraModel::kEquirectangular) return height / M_PI;
  return RowOf(model).num_focals == 2 ? params[1] : params[0];
}

Eigen::Vector2d Camera::PrincipalPoint() const {
  if (model == CameraModel::kEquirectangular) return {0.5 * width, 0.5 * height};
  const int first = RowOf(model).num_focals;
  return {params[first], params[first + 1]};
}

Status CheckCamera(const Camera& camera) {
  if (static_cast<int>(camera.params.size()) != NumCameraParams(camera.model)) {
    return MakeError(ErrorCode::kInvalidArgument, "camera {}: {} takes {} parameters, found {}",
                     camera.camera_id, CameraModelName(camera.model), NumCameraParams(camera.model),
                     camera.params.size());
  }
  for (const double param : camera.params) {
    if (!std::isfinite(param)) {
      return MakeError(ErrorCode::kInvalidArgument, "camera {}: a parameter is not a finite number",
                       camera.camera_id);
    }
  }
  if (camera.width <= 0 || camera.height <= 0 || camera.width > 65536 || camera.height > 65536) {
    return MakeError(ErrorCode::kInvalidArgument, "camera {}: image size {} x {} px is not in 1 .. 65536",
                     camera.camera_id, camera.width, camera.height);
  }
  if (camera.FocalX() <= 0 || camera.FocalY() <= 0) {
    return MakeError(ErrorCode::kInvalidArgument, "camera {}: focal length must be positive, found {} and {}",
                     camera.camera_id, camera.FocalX(), camera.FocalY());
  }
  if (camera.model == CameraModel::kFov && !(std::abs(camera.params[4]) < M_PI)) {
    return MakeError(ErrorCode::kInvalidArgument, "camera {}: FOV's omega is {} rad, expected less than pi",
                     camera.camera_id, camera.params[4]);
  }
  return Ok();
}

Result<Camera> CameraFromWords(const std::vector<std::string>& words, size_t first) {
  if (words.size() < first + 3) {
    return MakeError(ErrorCode::kCorrupt, "expected MODEL WIDTH HEIGHT PARAMS, found {} fields",
                     words.size() - first);
  }
  Camera camera;
  CAIRN_ASSIGN_OR_RETURN(camera.model, CameraModelFromName(words[first]));
  uint32_t width = 0, height = 0;
  if (!ParseNumber(words[first + 1], &width) || !ParseNumber(words[first + 2], &height)) {
    return MakeError(ErrorCode::kCorrupt, "image size '{} x {}' is not two positive integers",
                     words[first + 1], words[first + 2]);
  }
  camera.width = static_cast<int>(std::min(width, 1u << 30));
  camera.height = static_cast<int>(std::min(height, 1u << 30));
  for (size_t i = first + 3; i < words.size(); ++i) {
    double param = 0;
    if (!ParseNumber(words[i], &param)) {
      return MakeError(ErrorCode::kCorrupt, "camera parameter '{}' is not a number", words[i]);
    }
    camera.params.push_back(param);
  }
  // Some programs repeat a panorama's size as its parameters.
  const bool repeats_size = camera.params == PooledVector<double>{double(width), double(height)};
  if (camera.model == CameraModel::kEquirectangular && repeats_size) camera.params.clear();
  CAIRN_RETURN_IF_ERROR(CheckCamera(camera));
  return camera;
}

Camera GuessCamera(CameraId camera_id, int width, int height) {
  Camera camera;
  camera.camera_id = camera_id;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = width;
  camera.height = height;
  camera.params = {1.2 * std::max(width, height), 0.5 * width, 0.5 * height};
  camera.has_focal_prior = false;
  return camera;
}

std::optional<Eigen::Vector2d> ImageFromCamera(const Camera& camera, const Eigen::Vector3d& point_in_cam) {
  if (camera.model == CameraModel::kEquirectangular) return EquirectangularFromCamera(camera, point_in_cam);
  const std::optional<Eigen::Vector2d> d = DistortedFromCamera(camera, point_in_cam);
  if (!d) return std::nullopt;
  const Eigen::Vector2d c = camera.PrincipalPoint();
  return Eigen::Vector2d(camera.FocalX() * d->x() + c.x(), camera.FocalY() * d->y() + c.y());
}

std::optional<Eigen::Vector3d> BearingFromImage(const Camera& camera, const Eigen::Vector2d& pixel) {
  if (!pixel.allFinite()) return std::nullopt;
  if (camera.model == CameraModel::kEquirectangular) return BearingFromEquirectangular(camera, pixel);
  const std::optional<Eigen::Vector2d> a = UndistortedFromImage(camera, pixel);
  if (!a) return std::nullopt;
  return IsPerspective(camera) ? a->homogeneous().normalized() : BearingFromAngle(*a);
}

std::optional<Eigen::Vector2d> CameraFromImage(const Camera& camera, const Eigen::Vector2d& pixel) {
  if (IsPerspective(camera)) return UndistortedFromImage(camera, pixel);
  const std::optional<Eigen::Vector3d> bearing = BearingFromImage(camera, pixel);
  if (!bearing || !(bearing->z() >= std::cos(kMaxForwardAngle))) return std::nullopt;
  return bearing->hnormalized();
}

}  // namespace cairn
