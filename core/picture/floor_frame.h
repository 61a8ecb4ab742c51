#pragma once

#include <string>

#include <Eigen/Core>

namespace cairn {

// Where places of the floor (metres, y up) stand in a picture (pixels, y down).
struct FloorFrame {
  Eigen::Vector2d low = Eigen::Vector2d::Zero();  // the part of the floor that is drawn, floor frame, metres
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
  double px_per_m = 1;
  double left_px = 0, top_px = 0;  // of that part in the picture

  Eigen::Vector2d Pixel(const Eigen::Vector2d& place) const {
    return {left_px + (place.x() - low.x()) * px_per_m, top_px + (high.y() - place.y()) * px_per_m};
  }
  double WidthPx() const { return (high.x() - low.x()) * px_per_m; }
  double HeightPx() const { return (high.y() - low.y()) * px_per_m; }
};

// Corners of an arrow that points away from `center` (pixels): several at one place leave each other room.
std::string ArrowPoints(const Eigen::Vector2d& center, double heading_deg, double size_px);

// A bar with its length: the longest of 1, 2 or 5 times a power of ten metres that has at most `most_px`.
// Its left upper end is at (x_px, y_px); it is 8 pixels high, and the text stands to its right.  `unit`:
// where lengths are no metres.
std::string ScaleBar(double x_px, double y_px, double px_per_m, double most_px, const char* unit = "m");

}  // namespace cairn
