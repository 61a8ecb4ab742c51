#pragma once

#include <optional>

#include <Eigen/Core>

namespace cairn {

// How a thing appears after the camera has turned (x, y from the image's middle, px; log2 of its scale in
// px): the rotation turned_from_camera applied to the image of a pinhole camera of `focal_px`.  The scale
// changes as the root of the area.  Nothing where the thing is no longer in front (80 degrees off the axis).
std::optional<Eigen::Vector3d> TurnedSight(const Eigen::Vector3d& seen,
                                           const Eigen::Matrix3d& turned_from_camera, double focal_px);
// The rotation of a camera that turns left, then looks up, then rolls clockwise.
Eigen::Matrix3d CameraTurn(double left_rad, double up_rad = 0, double clockwise_rad = 0);
// How far a thing moves down in a level camera's image per metre that the camera is held higher, px: as far
// as it moves to the left per metre that the camera moves to the right (of a pinhole, both are focal length
// over depth), and never up.  `gradient`: of (x, y, ...) in the image by the camera's place on the floor, px
// / m; the camera looks along `heading_rad`, counter-clockwise from +x.
double RiseOf(const Eigen::Matrix<double, 3, 2>& gradient, double heading_rad);

}  // namespace cairn
