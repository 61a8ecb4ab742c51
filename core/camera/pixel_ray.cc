#include "core/camera/pixel_ray.h"

#include <Eigen/Geometry>

namespace cairn {
namespace {

bool IsPerspective(CameraModel model) {
  return model != CameraModel::kOpenCvFisheye && model < CameraModel::kFov;
}

// d pixel / d point at the unit vector `bearing`, by central differences in its tangent plane or, for
// perspective models, of x and y.
std::optional<Eigen::Matrix<double, 2, 3>> PixelFromPlane(const Camera& camera,
                                                          const Eigen::Vector3d& bearing,
                                                          bool is_perspective) {
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 3, 2> axes;
  if (is_perspective) {
    axes << 1, 0, 0, 1, 0, 0;
  } else {
    axes.col(0) = bearing.unitOrthogonal();
    axes.col(1) = bearing.cross(axes.col(0));
  }
  const Eigen::Vector3d on_plane = is_perspective ? Eigen::Vector3d(bearing / bearing.z()) : bearing;
  Eigen::Matrix2d jacobian;
  for (int axis = 0; axis < 2; ++axis) {
    const auto ahead = ImageFromCamera(camera, on_plane + kStep * axes.col(axis));
    const auto behind = ImageFromCamera(camera, on_plane - kStep * axes.col(axis));
    if (!ahead || !behind) return std::nullopt;
    jacobian.col(axis) = (*ahead - *behind) / (2 * kStep);
  }
  // Coordinates in the plane, less those of the ray: both are linear in x / (normal . x).
  Eigen::Matrix<double, 2, 3> coordinates = axes.transpose();
  if (is_perspective) coordinates.col(2) -= on_plane.head<2>();
  return jacobian * coordinates;
}

}  // namespace

std::optional<PixelRay> MakePixelRay(const Camera& camera, const Eigen::Vector2d& pixel) {
  const std::optional<Eigen::Vector3d> bearing = BearingFromImage(camera, pixel);
  if (!bearing) return std::nullopt;
  PixelRay ray;
  ray.bearing = *bearing;
  const bool is_perspective = IsPerspective(camera.model);
  if (!is_perspective) ray.normal = *bearing;
  const auto pixel_from_plane = PixelFromPlane(camera, *bearing, is_perspective);
  if (!pixel_from_plane) return std::nullopt;
  ray.pixel_from_plane = *pixel_from_plane;
  return ray;
}

double DepthOfScale(const Camera& camera, const Eigen::Vector3d& point_in_cam) {
  return IsPerspective(camera.model) ? point_in_cam.z() : point_in_cam.norm();
}

PixelRay WithFocalRatio(const PixelRay& ray, double ratio) {
  PixelRay scaled = ray;
  scaled.pixel_from_plane.leftCols<2>() *= ratio;
  scaled.bearing.head<2>() /= ratio;
  scaled.bearing.normalize();
  return scaled;
}

}  // namespace cairn
