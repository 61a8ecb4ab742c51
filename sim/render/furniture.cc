#include "sim/render/furniture.h"

#include <algorithm>
#include <cmath>

#include "core/base/random.h"

namespace cairn::sim {
namespace {

constexpr int kMaxAttemptsPerRoom = 200;
// Kept free in front of a door, metres.
constexpr double kDoorApproachM = 0.8;
// Gap between pieces that do not touch, metres.
constexpr double kGapM = 0.05;
// Edge of a cell of the raster on which connectedness is tested, metres.
constexpr double kCellM = 0.05;
constexpr double kPillarEdgeM = 0.35;

// Whether the cells of a room that keep `clearance` from its walls and obstacles are one 4-connected part
// with a cell in front of each door.
bool StaysConnected(const Rect& room, const std::vector<Rect>& obstacles, const std::vector<Rect>& approaches,
                    double clearance) {
  const Rect inner = room.Grown(-clearance);
  const int cols = static_cast<int>(inner.width() / kCellM) + 1,
            rows = static_cast<int>(inner.depth() / kCellM) + 1;
  if (inner.width() <= 0 || inner.depth() <= 0) return false;
  std::vector<char> is_free(static_cast<size_t>(cols) * rows, 1);
  for (const Rect& obstacle : obstacles) {
    const Rect grown = obstacle.Grown(clearance);
    const int x0 = std::max(0, static_cast<int>(std::ceil((grown.x0 - inner.x0) / kCellM)));
    const int x1 = std::min(cols - 1, static_cast<int>(std::floor((grown.x1 - inner.x0) / kCellM)));
    const int y0 = std::max(0, static_cast<int>(std::ceil((grown.y0 - inner.y0) / kCellM)));
    const int y1 = std::min(rows - 1, static_cast<int>(std::floor((grown.y1 - inner.y0) / kCellM)));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) is_free[static_cast<size_t>(y) * cols + x] = 0;
    }
  }
  const size_t num_free = std::count(is_free.begin(), is_free.end(), 1);
  const auto start = std::find(is_free.begin(), is_free.end(), 1);
  if (start == is_free.end()) return false;
  std::vector<int> stack = {static_cast<int>(start - is_free.begin())};
  *start = 2;
  size_t num_reached = 0;
  while (!stack.empty()) {
    const int cell = stack.back();
    stack.pop_back();
    ++num_reached;
    const int x = cell % cols, y = cell / cols;
    const auto visit = [&](int nx, int ny) {
      if (nx < 0 || ny < 0 || nx >= cols || ny >= rows) return;
      const int next = ny * cols + nx;
      if (is_free[next] == 1) is_free[next] = 2, stack.push_back(next);
    };
    visit(x - 1, y), visit(x + 1, y), visit(x, y - 1), visit(x, y + 1);
  }
  if (num_reached != num_free) return false;
  return std::all_of(approaches.begin(), approaches.end(), [&](const Rect& approach) {
    const int x =
        std::clamp(static_cast<int>(((approach.x0 + approach.x1) / 2 - inner.x0) / kCellM), 0, cols - 1);
    const int y =
        std::clamp(static_cast<int>(((approach.y0 + approach.y1) / 2 - inner.y0) / kCellM), 0, rows - 1);
    return is_free[static_cast<size_t>(y) * cols + x] == 2;
  });
}

// The floor in front of the room's doors.
std::vector<Rect> DoorApproaches(const Layout& layout, const Rect& room) {
  std::vector<Rect> approaches;
  for (const Wall& wall : layout.walls) {
    for (const auto& [low, high] : wall.doors) {
      const Rect& w = wall.rect;
      const Rect approach = wall.along_x ? Rect{low, w.y0 - kDoorApproachM, high, w.y1 + kDoorApproachM}
                                         : Rect{w.x0 - kDoorApproachM, low, w.x1 + kDoorApproachM, high};
      const Rect part = {std::max(approach.x0, room.x0), std::max(approach.y0, room.y0),
                         std::min(approach.x1, room.x1), std::min(approach.y1, room.y1)};
      if (part.width() > 0.1 && part.depth() > 0.1) approaches.push_back(part);
    }
  }
  return approaches;
}

// A cabinet, table or box somewhere in the room; most stand against a wall.
Furniture ProposePiece(const Rect& room, Random& random) {
  Furniture piece;
  double length = 0, depth = 0;
  const int64_t kind = random.UniformInt(0, 3);
  if (kind == 0) {  // high cabinet
    length = random.Uniform(0.7, 1.5), depth = random.Uniform(0.35, 0.5),
    piece.height_m = random.Uniform(1.6, 2.0);
  } else if (kind == 1) {  // sideboard
    length = random.Uniform(0.8, 1.6), depth = random.Uniform(0.4, 0.55),
    piece.height_m = random.Uniform(0.8, 1.2);
  } else if (kind == 2) {  // table
    length = random.Uniform(1.0, 1.6), depth = random.Uniform(0.6, 0.8),
    piece.height_m = random.Uniform(0.6, 0.78);
  } else {  // box
    length = random.Uniform(0.35, 0.7), depth = random.Uniform(0.35, 0.7),
    piece.height_m = random.Uniform(0.3, 0.9);
  }
  const bool along_x = random.Uniform() < 0.5;
  const double dx = along_x ? length : depth, dy = along_x ? depth : length;
  double x = random.Uniform(room.x0, std::max(room.x0, room.x1 - dx));
  double y = random.Uniform(room.y0, std::max(room.y0, room.y1 - dy));
  const bool at_wall = kind < 2 || random.Uniform() < 0.5;
  if (at_wall && along_x) y = random.Uniform() < 0.5 ? room.y0 : room.y1 - dy;
  if (at_wall && !along_x) x = random.Uniform() < 0.5 ? room.x0 : room.x1 - dx;
  piece.rect = {x, y, x + dx, y + dy};
  return piece;
}

Furniture ProposePillar(const Rect& room, double height_m, Random& random) {
  const double x = random.Uniform(room.x0, room.x1 - kPillarEdgeM);
  const double y = random.Uniform(room.y0, room.y1 - kPillarEdgeM);
  return {{x, y, x + kPillarEdgeM, y + kPillarEdgeM}, height_m, true};
}

// Whether a piece may stand there beside what the room has.
bool Fits(const Rect& rect, const Rect& room, const std::vector<Rect>& obstacles,
          const std::vector<Rect>& approaches, double clearance) {
  if (rect.x1 > room.x1 || rect.y1 > room.y1) return false;
  const auto overlaps = [](const Rect& a) { return [&a](const Rect& b) { return a.Overlaps(b); }; };
  const Rect grown = rect.Grown(kGapM);
  if (std::any_of(obstacles.begin(), obstacles.end(), overlaps(grown)) ||
      std::any_of(approaches.begin(), approaches.end(), overlaps(rect)))
    return false;
  std::vector<Rect> all = obstacles;
  all.push_back(rect);
  return StaysConnected(room, all, approaches, clearance);
}

// `pieces`: all that stand in the building by now.  Nothing where no place is found, or the piece is in no
// room.
std::optional<Rect> PlaceElsewhere(const SimulateOptions& options, const Layout& layout,
                                   const std::vector<std::optional<Furniture>>& pieces, size_t piece,
                                   uint64_t seed) {
  const Rect& old = pieces[piece]->rect;
  const auto room = std::find_if(layout.rooms.begin(), layout.rooms.end(),
                                 [&](const Room& other) { return other.rect.Overlaps(old); });
  if (room == layout.rooms.end()) return std::nullopt;
  const Rect& in = room->rect;
  std::vector<Rect> obstacles;
  for (size_t i = 0; i < pieces.size(); ++i) {
    if (i != piece && pieces[i] && pieces[i]->rect.Overlaps(in)) obstacles.push_back(pieces[i]->rect);
  }
  const std::vector<Rect> approaches = DoorApproaches(layout, in);
  const bool at_wall_x = old.x0 == in.x0 || old.x1 == in.x1, at_wall_y = old.y0 == in.y0 || old.y1 == in.y1;
  Random random(seed);
  for (int attempt = 0; attempt < kMaxAttemptsPerRoom; ++attempt) {
    double x = random.Uniform(in.x0, std::max(in.x0, in.x1 - old.width()));
    double y = random.Uniform(in.y0, std::max(in.y0, in.y1 - old.depth()));
    const bool at_far_end = random.Uniform() < 0.5;
    if (at_wall_x) x = at_far_end ? in.x1 - old.width() : in.x0;
    if (at_wall_y && !at_wall_x) y = at_far_end ? in.y1 - old.depth() : in.y0;
    const Rect rect = {x, y, x + old.width(), y + old.depth()};
    if (!rect.Overlaps(old) && Fits(rect, in, obstacles, approaches, options.clearance_m)) return rect;
  }
  return std::nullopt;
}

}  // namespace

void PlaceFurniture(const SimulateOptions& options, uint64_t seed, Layout* layout) {
  for (size_t r = 0; r < layout->rooms.size(); ++r) {
    const Room& room = layout->rooms[r];
    if (room.is_corridor) continue;
    Random random(MixSeed(MixSeed(seed, 2), r));
    const std::vector<Rect> approaches = DoorApproaches(*layout, room.rect);
    std::vector<Rect> obstacles;
    const auto place = [&](const Furniture& piece) {
      if (piece.height_m >= options.height_m && !piece.is_pillar) return false;
      if (!Fits(piece.rect, room.rect, obstacles, approaches, options.clearance_m)) return false;
      obstacles.push_back(piece.rect);
      layout->furniture.push_back(piece);
      return true;
    };
    int num_pillars = static_cast<int>(options.pillars_per_room);
    if (random.Uniform() < options.pillars_per_room - num_pillars) ++num_pillars;
    double area_left = options.furniture_ratio * room.rect.area();
    for (int attempt = 0; attempt < kMaxAttemptsPerRoom; ++attempt) {
      if (num_pillars > 0) {
        if (place(ProposePillar(room.rect, options.height_m, random))) --num_pillars;
      } else if (area_left > 0) {
        const Furniture piece = ProposePiece(room.rect, random);
        if (piece.rect.area() <= 1.5 * area_left && place(piece)) area_left -= piece.rect.area();
      }
    }
  }
}

std::vector<std::optional<Furniture>> FurnitureAfterChange(const SimulateOptions& options, uint64_t seed,
                                                           const Layout& layout) {
  std::vector<std::optional<Furniture>> pieces(layout.furniture.begin(), layout.furniture.end());
  if (options.change == 0) return pieces;
  std::vector<size_t> moved;
  for (size_t i = 0; i < pieces.size(); ++i) {
    if (pieces[i]->is_pillar) continue;
    Random random(MixSeed(MixSeed(MixSeed(seed, 7), options.change), i));
    if (random.Uniform() < options.removed_furniture_ratio) {
      pieces[i].reset();
    } else if (random.Uniform() < options.moved_furniture_ratio) {
      moved.push_back(i);
    }
  }
  for (const size_t i : moved) {
    const std::optional<Rect> rect =
        PlaceElsewhere(options, layout, pieces, i, MixSeed(MixSeed(MixSeed(seed, 9), options.change), i));
    if (rect) pieces[i]->rect = *rect;
  }
  return pieces;
}

}  // namespace cairn::sim
