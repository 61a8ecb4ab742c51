#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/render/options.h"

namespace cairn::sim {

// An axis-parallel rectangle on the floor, metres.
struct Rect {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  double width() const { return x1 - x0; }
  double depth() const { return y1 - y0; }
  double area() const { return width() * depth(); }
  bool Overlaps(const Rect& other) const {
    return x0 < other.x1 && other.x0 < x1 && y0 < other.y1 && other.y0 < y1;
  }
  Rect Grown(double margin) const { return {x0 - margin, y0 - margin, x1 + margin, y1 + margin}; }
};

// Distance from a point to a rectangle, 0 inside.
double DistanceToRect(const Rect& rect, double x, double y);

struct Room {
  std::string name;  // "room 0", ..., "corridor 0", ..., "spine"
  Rect rect;
  bool is_corridor = false;
};

// A straight wall with openings, each an interval along the wall (x for walls along x, else y).
struct Wall {
  Rect rect;
  bool along_x = true;
  std::vector<std::pair<double, double>> doors;  // ascending
  std::vector<double> joints;                    // ascending: places along it where a panel ends
};

// Something that stands on the floor.
struct Furniture {
  Rect rect;
  double height_m = 0;
  bool is_pillar = false;
};

// A part of a building that looks like another: `rect` and the same moved along x.
struct Twins {
  Rect rect;
  double offset_m = 0;
  double wing_y = 0;  // where the wings begin
};

// The plan of a building.  Rooms stand in strips on both sides of corridors along x; where there are several
// corridors, a spine along y joins them.
//      +--------+-----+--------+
//      | room 2 | r 3 | room 4 |      every room has a door to its corridor; some neighbours
//      +-- -----+- ---+----- --+      are joined directly as well
//      |       corridor        |
//      +----- -----+-- --------+
//      |  room 0       room 1  |
//      +-----------+-----------+
struct Layout {
  Rect bounds;  // the inner sides of the outer walls
  std::vector<Room> rooms;
  std::vector<Wall> walls;  // the four outer ones first
  std::vector<Furniture> furniture;
  std::optional<Twins> twins;  // with twin_wings only (twin_wings.h)
};

// Lays out the building; the same options and seed give the same layout.
// Errors: InvalidArgument when rooms and corridors do not fit.
Result<Layout> MakeLayout(const SimulateOptions& options, uint64_t seed);

}  // namespace cairn::sim
