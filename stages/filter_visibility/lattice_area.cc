#include "stages/filter_visibility/lattice_area.h"

#include <algorithm>

namespace cairn::filter_visibility {
namespace {

// The part of the lattice around an area, one cell wider on every side.
class Window {
 public:
  enum Content : char { kOutside, kArea, kSeen };

  Window(const std::vector<StationIdx>& area, const Stations& stations) : stations_(stations) {
    int max_x = stations.cells[area[0]].first, max_y = stations.cells[area[0]].second;
    min_x_ = max_x, min_y_ = max_y;
    for (const StationIdx station : area) {
      const auto [x, y] = stations.cells[station];
      min_x_ = std::min(min_x_, x), max_x = std::max(max_x, x);
      min_y_ = std::min(min_y_, y), max_y = std::max(max_y, y);
    }
    --min_x_, --min_y_;
    width_ = max_x - min_x_ + 2;
    height_ = max_y - min_y_ + 2;
    content_.assign(static_cast<size_t>(width_) * height_, kOutside);
    for (const StationIdx station : area) At(stations.cells[station]) = kArea;
  }

  int width() const { return width_; }
  int height() const { return height_; }
  Cell CellAt(int column, int row) const { return {min_x_ + column, min_y_ + row}; }
  bool Contains(const Cell& cell) const {
    return cell.first >= min_x_ && cell.second >= min_y_ && cell.first < min_x_ + width_ &&
           cell.second < min_y_ + height_;
  }
  bool InArea(const Cell& cell) const { return Contains(cell) && At(cell) == kArea; }

  // Marks the cells outside of the area that are joined to `start` over 8 neighbours; returns the stations
  // among them.
  int Flood(const Cell& start) {
    if (At(start) != kOutside) return 0;
    int num_stations = 0;
    std::vector<Cell> stack = {start};
    At(start) = kSeen;
    while (!stack.empty()) {
      const Cell cell = stack.back();
      stack.pop_back();
      num_stations += static_cast<int>(stations_.station_at.count(cell));
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const Cell next(cell.first + dx, cell.second + dy);
          if (!Contains(next) || At(next) != kOutside) continue;
          At(next) = kSeen;
          stack.push_back(next);
        }
      }
    }
    return num_stations;
  }

 private:
  char& At(const Cell& cell) {
    return content_[static_cast<size_t>(cell.second - min_y_) * width_ + (cell.first - min_x_)];
  }
  char At(const Cell& cell) const { return const_cast<Window*>(this)->At(cell); }

  const Stations& stations_;
  int min_x_, min_y_, width_, height_;
  std::vector<char> content_;
};

int NumNeighboursInside(const Window& window, const Cell& cell) {
  int num = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      num += (dx != 0 || dy != 0) && window.InArea({cell.first + dx, cell.second + dy});
    }
  }
  return num;
}

}  // namespace

std::vector<int> HoleSizes(const std::vector<StationIdx>& area, const Stations& stations) {
  std::vector<int> sizes;
  if (area.empty()) return sizes;
  Window window(area, stations);
  window.Flood(window.CellAt(0, 0));  // all that surrounds the area
  for (int row = 0; row < window.height(); ++row) {
    for (int column = 0; column < window.width(); ++column) {
      if (const int size = window.Flood(window.CellAt(column, row)); size > 0) sizes.push_back(size);
    }
  }
  return sizes;
}

bool HasBlock(const std::vector<StationIdx>& area, const Stations& stations, int side) {
  if (area.empty()) return false;
  const Window window(area, stations);
  return std::any_of(area.begin(), area.end(), [&](StationIdx station) {
    const auto [x, y] = stations.cells[station];
    for (int dy = 0; dy < side; ++dy) {
      for (int dx = 0; dx < side; ++dx) {
        if (!window.InArea({x + dx, y + dy})) return false;
      }
    }
    return true;
  });
}

std::vector<StationIdx> TrimArea(const std::vector<StationIdx>& area, const Stations& stations,
                                 int min_num_neighbours) {
  std::vector<StationIdx> kept;
  if (area.empty()) return kept;
  const Window window(area, stations);
  for (const StationIdx station : area) {
    const auto [x, y] = stations.cells[station];
    bool keep = false;
    for (int dy = -1; dy <= 1 && !keep; ++dy) {
      for (int dx = -1; dx <= 1 && !keep; ++dx) {
        const Cell cell(x + dx, y + dy);
        // [Sala06 §VI-B] a neighbour, here or the station itself, with enough of its 8 neighbours in the area
        keep = window.InArea(cell) && NumNeighboursInside(window, cell) >= min_num_neighbours;
      }
    }
    if (keep) kept.push_back(station);
  }
  return kept;
}

}  // namespace cairn::filter_visibility
