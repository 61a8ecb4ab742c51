#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/blocks/map_rows.h"
#include "core/picture/floor_frame.h"

namespace cairn::pipeline {

// A map's floor as pictures and the report show it: a title above, a legend below.
struct FloorView : FloorFrame {
  static constexpr double kPictureWidthPx = 1000;
  static constexpr double kTitlePx = 56;
  static constexpr double kLegendPx = 64;
  static constexpr int kFontPx = 15;

  double PictureHeightPx() const { return kTitlePx + HeightPx() + kLegendPx; }
};

// Shows all stations, and all but the outermost of some other places (floor frame, metres).
FloorView MakeFloorView(const MapRows& rows, const std::vector<Eigen::Vector2d>& others);

}  // namespace cairn::pipeline
