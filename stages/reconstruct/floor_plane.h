#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"

namespace cairn::reconstruct {

// A point of a reconstruction, and the cameras that see it, by index.
struct SeenPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::vector<int> cameras;
};

// The floor under a camera that is carried at one height, in the reconstruction's units.
struct FloorPlane {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // its normal, towards the cameras
  double height = 0;                              // median of the cameras' over it
  double sigma_ratio = 0;                         // standard deviation of that, as a part of it
  std::vector<int> cameras;                       // that see enough of it, ascending
  std::vector<double> heights;                    // of each of them over what it sees of the floor
  int num_points = 0;
};

// The plane below the cameras that most points lie on, and how high they are over it.
//   Points below the cameras that see them vote for planes through three of them [Fischler81], within 15
// degrees of level: level is perpendicular to `up`, or where the cameras moved over a plane, their plane.  A
// point is on a plane within 1/20 of the cameras' median height over it.  Each camera's height is taken over
// the points of the floor that it sees itself, so that a bent reconstruction has a floor too; the height is
// the median, and its standard deviation that of single cameras over the root of a tenth of their number, as
// neighbours see the same floor, and at least 1/200.
// Pure; its random numbers have a fixed seed.  O(points * 500).  Errors: NoData, which says what was found
// (few points below the cameras, or on any plane, or no more than above it; a plane with much below it, which
// is a table; a second floor below it; cameras at no one height).
Result<FloorPlane> FindFloor(const std::vector<SeenPoint>& points,
                             const std::vector<Eigen::Vector3d>& camera_centers, const Eigen::Vector3d& up);

}  // namespace cairn::reconstruct
