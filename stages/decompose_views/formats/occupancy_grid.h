#pragma once

#include <cstdint>
#include <string>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"

namespace cairn::decompose_views {

// What a grid says of a cell.
enum class CellState : uint8_t { kFree = 0, kOccupied = 1, kUnknown = 2 };

// A map as ROS's map_server has it: cells in rows, of which a laser's beams passed some and ended in others.
struct OccupancyGrid {
  cv::Mat cells;            // CV_8UC1, a CellState each; row 0 is the image's lowest, column 0 its leftmost
  double resolution_m = 0;  // the side of a cell
  PlanarPose origin;        // of the outer corner of cell (0, 0), in the map's frame

  // Of a place in cells from the corner of cell (0, 0), whose middle is (0.5, 0.5); in the map's frame,
  // metres.
  Eigen::Vector2d Metres(const Eigen::Vector2d& cells_from_corner) const {
    return origin.FloorFromRobot(resolution_m * cells_from_corner);
  }
};

// Most cells of a grid that is read: 8192 x 8192, at 5 cm a cell 410 m x 410 m.
inline constexpr int64_t kMaxNumCells = int64_t{1} << 26;

// Reads a map's YAML file (http://wiki.ros.org/map_server: image, resolution, origin [x, y, yaw], negate,
// occupied_thresh, free_thresh; mode trinary, scale or raw, trinary where it is missing) and the image that
// it names, PGM (P2 or P5, of 255 grey levels) or PNG without transparency, in the file's folder or below it.
// With o = (255 - grey) / 255, negated grey / 255, a cell is occupied where o > occupied_thresh, free where
// o < free_thresh, else unknown, in trinary and in scale; in raw, grey 0 to 100 are per cent and others
// unknown. Errors: NotFound; Corrupt (no such YAML, a missing key, a value out of range: with its line; an
// image that is cut short); InvalidArgument (an image outside of the folder); Unsupported (another kind of
// image, more than kMaxNumCells, found before anything of that size is read).
Result<OccupancyGrid> ReadOccupancyGrid(const std::string& path);

// The file of the image that a map's YAML file names; what reading the map depends on besides.  Errors: as
// above.
Result<std::string> ImageOfOccupancyGrid(const std::string& path);

}  // namespace cairn::decompose_views
