#pragma once

#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/plan/views.h"

namespace cairn::decompose_views {

// Things drawn over a plan, floor frame, metres.
struct ViewsOverlay {
  struct Robot {
    Eigen::Vector2d position;
    double heading_rad = 0;
    std::string caption;  // beside it
  };
  struct Line {
    Eigen::Vector2d start, end;
    bool strong = false;  // matched segments; others are drawn thin and dashed
  };
  std::vector<Robot> robots;
  // Ends of the beams of the first robot, in their order, and whether they met something.
  std::vector<std::pair<Eigen::Vector2d, bool>> beams;
  std::vector<Line> segments;                       // of a scan
  std::vector<std::vector<Eigen::Vector2d>> paths;  // polylines, an arrow at the end of each
  std::vector<std::vector<Eigen::Vector2d>> areas;  // polygons, shaded
  std::vector<std::string> captions;                // lines of the legend
};

// A plan and its regions from above as SVG: each region in a shade for the number of walls that it sees
// (darker: more), view boundaries between them, walls in black, a scale bar and a legend, with `overlay` on
// top.  Regions too small to be seen are not drawn; with `regions` false only the walls are drawn.  Same
// views, same bytes.
std::string DrawViews(const Views& views, const ViewsOverlay& overlay = {}, bool regions = true);

}  // namespace cairn::decompose_views
