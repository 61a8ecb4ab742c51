#include "core/camera.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace cairn {
namespace {

struct ModelRow {
  CameraModel model;
  const char* name;
  int num_params;
  int num_focals;  // 1: f shared by both axes, 2: fx, fy
};

constexpr std::array<ModelRow, 7> kModels = {{
    {CameraModel::kSimplePinhole, "SIMPLE_PINHOLE", 3, 1},
    {CameraModel::kPinhole, "PINHOLE", 4, 2},
    {CameraModel::kSimpleRadial, "SIMPLE_RADIAL", 4, 1},
    {CameraModel::kRadial, "RADIAL", 5, 1},
    {CameraModel::kOpenCv, "OPENCV", 8, 2},
    {CameraModel::kOpenCvFisheye, "OPENCV_FISHEYE", 8, 2},
    {CameraModel::kFullOpenCv, "FULL_OPENCV", 12, 2},
}};

const ModelRow& RowOf(CameraModel model) { return kModels[static_cast<int>(model)]; }

std::string KnownModels() {
  std::string names;
  for (const ModelRow& row : kModels) names += (names.empty() ? "" : ", ") + std::string(row.name);
  return names;
}

// Distorted normalised coordinates, as COLMAP defines them for each model.
Eigen::Vector2d Distort(const Camera& camera, const Eigen::Vector2d& u) {
  const double* p = camera.params.data();
  const double r2 = u.squaredNorm();
  switch (camera.model) {
    case CameraModel::kSimplePinhole:
    case CameraModel::kPinhole:
      return u;
    case CameraModel::kSimpleRadial:
      return u * (1 + p[3] * r2);
    case CameraModel::kRadial:
      return u * (1 + p[3] * r2 + p[4] * r2 * r2);
    case CameraModel::kOpenCv: {
      const double radial = p[4] * r2 + p[5] * r2 * r2;
      const double uv = u.x() * u.y();
      return {u.x() + u.x() * radial + 2 * p[6] * uv + p[7] * (r2 + 2 * u.x() * u.x()),
              u.y() + u.y() * radial + 2 * p[7] * uv + p[6] * (r2 + 2 * u.y() * u.y())};
    }
    case CameraModel::kOpenCvFisheye: {
      const double r = std::sqrt(r2);
      if (r < 1e-12) return u;
      const double t = std::atan(r), t2 = t * t;
      return u * (t * (1 + t2 * (p[4] + t2 * (p[5] + t2 * (p[6] + t2 * p[7])))) / r);
    }
    case CameraModel::kFullOpenCv: {
      const double r4 = r2 * r2, r6 = r4 * r2, uv = u.x() * u.y();
      const double radial =
          (1 + p[4] * r2 + p[5] * r4 + p[8] * r6) / (1 + p[9] * r2 + p[10] * r4 + p[11] * r6);
      return {u.x() * radial + 2 * p[6] * uv + p[7] * (r2 + 2 * u.x() * u.x()),
              u.y() * radial + 2 * p[7] * uv + p[6] * (r2 + 2 * u.y() * u.y())};
    }
  }
  return u;
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
    if (id == static_cast<int>(row.model)) return row.model;
  }
  return MakeError(ErrorCode::kUnsupported, "unknown camera model number {}; known are 0 to 6: {}", id,
                   KnownModels());
}

double Camera::FocalY() const { return RowOf(model).num_focals == 2 ? params[1] : params[0]; }

Eigen::Vector2d Camera::PrincipalPoint() const {
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
  return Ok();
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
  if (!(point_in_cam.z() > 0)) return std::nullopt;
  const Eigen::Vector2d d = Distort(camera, point_in_cam.hnormalized());
  const Eigen::Vector2d c = camera.PrincipalPoint();
  return Eigen::Vector2d(camera.FocalX() * d.x() + c.x(), camera.FocalY() * d.y() + c.y());
}

std::optional<Eigen::Vector2d> CameraFromImage(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d c = camera.PrincipalPoint();
  const Eigen::Vector2d target((pixel.x() - c.x()) / camera.FocalX(), (pixel.y() - c.y()) / camera.FocalY());
  if (camera.model == CameraModel::kSimplePinhole || camera.model == CameraModel::kPinhole) return target;
  Eigen::Vector2d u = target;
  if (camera.model == CameraModel::kOpenCvFisheye) {  // its angle, not its tangent, is what the image shows
    const double theta = target.norm();
    if (theta >= 1.5) return std::nullopt;  // 86 degrees off the axis: no forward ray
    if (theta > 1e-9) u = target * (std::tan(theta) / theta);
  }
  constexpr int kMaxIterations = 50;
  constexpr double kStep = 1e-7;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::Vector2d residual = Distort(camera, u) - target;
    if (residual.squaredNorm() < 1e-20) return u;
    Eigen::Matrix2d jacobian;
    jacobian.col(0) =
        (Distort(camera, u + Eigen::Vector2d(kStep, 0)) - Distort(camera, u - Eigen::Vector2d(kStep, 0)));
    jacobian.col(1) =
        (Distort(camera, u + Eigen::Vector2d(0, kStep)) - Distort(camera, u - Eigen::Vector2d(0, kStep)));
    jacobian /= 2 * kStep;
    u -= jacobian.inverse() * residual;
    if (!u.allFinite() || u.squaredNorm() > 1e6) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace cairn
