#pragma once

#include <vector>

#include <Eigen/Core>

namespace cairn::emit_map {

// A keypoint as a bearing on the floor: the place and heading of the camera, and the ratio of right to ahead.
// Each is a length in px plus a part of the focal length, which the camera's tilt mixes into it.
struct FloorSight {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  // floor frame, metres
  double heading_rad = 0;
  Eigen::Vector2d right = {0, 0};  // px, focal lengths
  Eigen::Vector2d ahead = {0, 1};
};

// Estimates from a survey with known places and headings how far a turn of the camera moves its image: the
// focal length, px, at which the sights of each landmark (an element) meet best in a point of the floor, that
// is, with the smallest sum over sights of ln(1 + (error / 2 px)^2).  Wrong or moving landmarks have little
// effect.  0 where fewer than 20 landmarks have four sights, or the best is at the edge of 0.2 to 5
// image widths.
double LearnFocal(const std::vector<std::vector<FloorSight>>& landmarks, int image_width_px);

}  // namespace cairn::emit_map
