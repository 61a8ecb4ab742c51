#pragma once

#include <optional>

#include <Eigen/Core>

#include "core/camera/camera.h"

namespace cairn {

// A pixel as a ray, with the matrix that turns points near the ray into pixels near the pixel: code that uses
// it needs no camera model.  Points x of the camera frame are compared with the ray on the plane
// normal . x = 1:
//
//   residual(x) = pixel_from_plane * x / (normal . x)        px, zero on the ray
//
// For perspective models the plane is z = 1 and the residual is exact except for the distortion's change over
// it; for fisheye models it is the plane that touches the unit sphere at the bearing, so that rays beyond 90
// degrees off the axis are as good as others.  A point is in front of the ray when normal . x > 0.
struct PixelRay {
  Eigen::Vector3d bearing = Eigen::Vector3d::UnitZ();  // unit vector, camera frame
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  Eigen::Matrix<double, 2, 3> pixel_from_plane = Eigen::Matrix<double, 2, 3>::Zero();

  Eigen::Vector2d Residual(const Eigen::Vector3d& x) const { return pixel_from_plane * x / normal.dot(x); }
  // d residual / d x
  Eigen::Matrix<double, 2, 3> ResidualByPoint(const Eigen::Vector3d& x) const {
    return (pixel_from_plane - Residual(x) * normal.transpose()) / normal.dot(x);
  }
};

// The ray of a pixel.  Nothing where the model has none, or at the very fold of its distortion.
std::optional<PixelRay> MakePixelRay(const Camera& camera, const Eigen::Vector2d& pixel);

// The ray of the same pixel when the camera's focal lengths are `ratio` times as long.
// REQUIRES: the ray of a pinhole camera
PixelRay WithFocalRatio(const PixelRay& ray, double ratio);

// The distance d of a small thing at `point_in_cam` in size_px = focal_px * size_m / d: z for perspective
// models, the distance from the centre for the others, which show equal angles equally large.
double DepthOfScale(const Camera& camera, const Eigen::Vector3d& point_in_cam);

}  // namespace cairn
