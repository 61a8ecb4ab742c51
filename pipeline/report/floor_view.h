#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// What pictures of the floor have in common.  Pixels: x to the right, y down, a title above, a legend below.
struct FloorView {
  static constexpr double kWidthPx = 1000;
  static constexpr double kTitlePx = 56;
  static constexpr double kLegendPx = 64;
  static constexpr int kFontPx = 15;

  Eigen::Vector2d low = Eigen::Vector2d::Zero();  // the part of the floor that is drawn, floor frame, metres
  Eigen::Vector2d high = Eigen::Vector2d::Zero();
  double px_per_m = 1;
  double left_px = 0;

  Eigen::Vector2d Pixel(const Eigen::Vector2d& place) const {
    return {left_px + (place.x() - low.x()) * px_per_m, kTitlePx + (high.y() - place.y()) * px_per_m};
  }
  double HeightPx() const { return (high.y() - low.y()) * px_per_m; }
  double PictureHeightPx() const { return kTitlePx + HeightPx() + kLegendPx; }
};

// Shows all stations, and all but the outermost of some other places (floor frame, metres).
FloorView MakeFloorView(const MapRows& rows, const std::vector<Eigen::Vector2d>& others);

// Corners of an arrow that points away from `center` (pixels): several at one place leave each other room.
std::string ArrowPoints(const Eigen::Vector2d& center, double heading_deg, double size_px);

// A bar of 1, 2 or 5 times a power of ten metres, at the left of row `y`.
std::string DrawScaleBar(const FloorView& view, double y);

}  // namespace cairn::pipeline
