#include "sim/render/floor_plan.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <nlohmann/json.hpp>

#include "core/files/file.h"

namespace cairn::sim {
namespace {

using nlohmann::ordered_json;

// Corners are written in tenths of a millimetre; edges closer than that are treated as one.
constexpr double kGridM = 1e-4;

double Snapped(double value) { return std::round(value / kGridM) * kGridM; }
double Written(double value) { return std::round(value / kGridM) / (1 / kGridM); }

std::vector<double> SortedEdges(std::vector<double> values) {
  for (double& value : values) value = Snapped(value);
  std::sort(values.begin(), values.end());
  values.erase(
      std::unique(values.begin(), values.end(), [](double a, double b) { return b - a < kGridM / 2; }),
      values.end());
  return values;
}

int EdgeIndex(const std::vector<double>& edges, double value) {
  const auto at = std::lower_bound(edges.begin(), edges.end(), Snapped(value) - kGridM / 2);
  return static_cast<int>(at - edges.begin());
}

// The cells between all edges of all rectangles: each is free or not as a whole.
struct CellGrid {
  std::vector<double> xs, ys;
  std::vector<char> is_free;
  int cols() const { return static_cast<int>(xs.size()) - 1; }
  int rows() const { return static_cast<int>(ys.size()) - 1; }
  bool IsFree(int x, int y) const {
    return x >= 0 && y >= 0 && x < cols() && y < rows() && is_free[static_cast<size_t>(y) * cols() + x];
  }
};

CellGrid MakeCellGrid(const Rect& bounds, const std::vector<Rect>& obstacles) {
  std::vector<double> xs = {bounds.x0, bounds.x1}, ys = {bounds.y0, bounds.y1};
  for (const Rect& rect : obstacles) {
    for (const double x : {rect.x0, rect.x1}) xs.push_back(std::clamp(x, bounds.x0, bounds.x1));
    for (const double y : {rect.y0, rect.y1}) ys.push_back(std::clamp(y, bounds.y0, bounds.y1));
  }
  CellGrid grid{SortedEdges(xs), SortedEdges(ys), {}};
  grid.is_free.assign(static_cast<size_t>(grid.cols()) * grid.rows(), 1);
  for (const Rect& rect : obstacles) {
    const int x1 = std::min(EdgeIndex(grid.xs, rect.x1), grid.cols());
    const int y1 = std::min(EdgeIndex(grid.ys, rect.y1), grid.rows());
    for (int y = EdgeIndex(grid.ys, rect.y0); y < y1; ++y) {
      for (int x = EdgeIndex(grid.xs, rect.x0); x < x1; ++x)
        grid.is_free[static_cast<size_t>(y) * grid.cols() + x] = 0;
    }
  }
  return grid;
}

// All rings around free cells, free space on the left: outer rings counter-clockwise, holes clockwise.  Where
// two free cells touch at a corner only, rings turn left: they stay apart there.
std::vector<Ring> TraceRings(const CellGrid& grid) {
  using Corner = std::pair<int, int>;         // (y, x)
  std::map<Corner, std::vector<int>> starts;  // directions of edges that leave a corner, not yet walked
  constexpr int kDx[4] = {1, 0, -1, 0}, kDy[4] = {0, 1, 0, -1};  // right, up, left, down
  for (int y = 0; y < grid.rows(); ++y) {
    for (int x = 0; x < grid.cols(); ++x) {
      if (!grid.IsFree(x, y)) continue;
      if (!grid.IsFree(x, y - 1)) starts[{y, x}].push_back(0);
      if (!grid.IsFree(x + 1, y)) starts[{y, x + 1}].push_back(1);
      if (!grid.IsFree(x, y + 1)) starts[{y + 1, x + 1}].push_back(2);
      if (!grid.IsFree(x - 1, y)) starts[{y + 1, x}].push_back(3);
    }
  }
  std::vector<Ring> rings;
  while (!starts.empty()) {
    Ring ring;
    const Corner first = starts.begin()->first;
    Corner corner = first;
    int direction = -1;
    do {
      std::vector<int>& leaving = starts[corner];
      size_t choice = 0;
      if (direction >= 0) {
        const int left = (direction + 1) % 4;
        for (size_t i = 0; i < leaving.size(); ++i) {
          if (leaving[i] == left) choice = i;
        }
      }
      const int next = leaving[choice];
      leaving.erase(leaving.begin() + static_cast<std::ptrdiff_t>(choice));
      if (leaving.empty()) starts.erase(corner);
      if (next != direction)
        ring.push_back({Written(grid.xs[corner.second]), Written(grid.ys[corner.first])});
      direction = next;
      corner = {corner.first + kDy[next], corner.second + kDx[next]};
    } while (corner != first);
    rings.push_back(ring);
  }
  return rings;
}

double SignedArea(const Ring& ring) {
  double twice = 0;
  for (size_t i = 0; i < ring.size(); ++i) {
    const auto& a = ring[i];
    const auto& b = ring[(i + 1) % ring.size()];
    twice += a[0] * b[1] - b[0] * a[1];
  }
  return twice / 2;
}

bool Contains(const Ring& ring, double x, double y) {
  bool inside = false;
  for (size_t i = 0; i < ring.size(); ++i) {
    const auto& a = ring[i];
    const auto& b = ring[(i + 1) % ring.size()];
    if ((a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])) inside = !inside;
  }
  return inside;
}

ordered_json Coordinates(Ring ring) {
  ring.push_back(ring.front());  // GeoJSON closes its rings
  return ring;
}

Ring RectRing(const Rect& rect) {
  const double x0 = Written(rect.x0), y0 = Written(rect.y0), x1 = Written(rect.x1), y1 = Written(rect.y1);
  return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

ordered_json Coordinates(const PlanPolygon& polygon) {
  ordered_json rings = {Coordinates(polygon.outer)};
  for (const Ring& hole : polygon.holes) rings.push_back(Coordinates(hole));
  return rings;
}

ordered_json MakeFeature(const std::vector<PlanPolygon>& polygons, ordered_json properties) {
  ordered_json geometry;
  if (polygons.size() == 1) {
    geometry = {{"type", "Polygon"}, {"coordinates", Coordinates(polygons[0])}};
  } else {
    ordered_json parts = ordered_json::array();
    for (const PlanPolygon& polygon : polygons) parts.push_back(Coordinates(polygon));
    geometry = {{"type", "MultiPolygon"}, {"coordinates", parts}};
  }
  return {{"type", "Feature"}, {"properties", std::move(properties)}, {"geometry", geometry}};
}

std::vector<PlanPolygon> WallPieces(const Wall& wall) {
  std::vector<PlanPolygon> pieces;
  double low = wall.along_x ? wall.rect.x0 : wall.rect.y0;
  const double end = wall.along_x ? wall.rect.x1 : wall.rect.y1;
  const auto add = [&](double high) {
    if (high <= low) return;
    pieces.push_back({RectRing(wall.along_x ? Rect{low, wall.rect.y0, high, wall.rect.y1}
                                            : Rect{wall.rect.x0, low, wall.rect.x1, high}),
                      {}});
  };
  for (const auto& [door_low, door_high] : wall.doors) {
    add(door_low);
    low = door_high;
  }
  add(end);
  return pieces;
}

}  // namespace

std::vector<PlanPolygon> FreeSpace(const Rect& bounds, const std::vector<Rect>& obstacles) {
  std::vector<PlanPolygon> polygons;
  std::vector<Ring> holes;
  for (Ring& ring : TraceRings(MakeCellGrid(bounds, obstacles))) {
    if (SignedArea(ring) > 0) {
      polygons.push_back({std::move(ring), {}});
    } else {
      holes.push_back(std::move(ring));
    }
  }
  for (Ring& hole : holes) {
    // The middle of a hole's edge, moved a little to its free side, lies inside the polygon that it belongs
    // to and in no other: parts do not overlap, and a part inside another's hole is not around this edge.
    const auto& a = hole[0];
    const auto& b = hole[1];
    const double length = std::hypot(b[0] - a[0], b[1] - a[1]);
    const double x = (a[0] + b[0]) / 2 - (b[1] - a[1]) / length * kGridM / 4;
    const double y = (a[1] + b[1]) / 2 + (b[0] - a[0]) / length * kGridM / 4;
    PlanPolygon* owner = nullptr;
    for (PlanPolygon& polygon : polygons) {
      if (!Contains(polygon.outer, x, y)) continue;
      // Of nested candidates the smallest.
      if (owner == nullptr || SignedArea(polygon.outer) < SignedArea(owner->outer)) owner = &polygon;
    }
    if (owner != nullptr) owner->holes.push_back(std::move(hole));
  }
  return polygons;
}

Status WriteFloorPlan(const Layout& layout, const std::vector<Rect>& obstacles, const std::string& path) {
  ordered_json features = ordered_json::array();
  features.push_back(MakeFeature(FreeSpace(layout.bounds, obstacles), {{"kind", "free_space"}}));
  for (const Wall& wall : layout.walls) features.push_back(MakeFeature(WallPieces(wall), {{"kind", "wall"}}));
  for (const Furniture& piece : layout.furniture) {
    features.push_back(MakeFeature(
        {{RectRing(piece.rect), {}}},
        {{"kind", piece.is_pillar ? "pillar" : "furniture"}, {"height_m", Written(piece.height_m)}}));
  }
  for (const Room& room : layout.rooms) {
    features.push_back(MakeFeature({{RectRing(room.rect), {}}},
                                   {{"kind", room.is_corridor ? "corridor" : "room"}, {"name", room.name}}));
  }
  const ordered_json plan = {{"type", "FeatureCollection"}, {"features", features}};
  return WriteFileAtomically(path, plan.dump() + "\n");
}

}  // namespace cairn::sim
