#include "sim/survey/drive.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <queue>

#include "core/base/random.h"

namespace cairn::sim {
namespace {

// Edge of a cell of the raster on which ways are searched, metres.
constexpr double kCellM = 0.1;
// Places to visit in a room are at least this far from each other, metres.
constexpr double kVisitSpacingM = 1.5;
// Cells nearer than this to an obstacle cost more the nearer they are, metres.
constexpr double kComfortM = 0.7;
constexpr double kNearCost = 4;
constexpr int kSmoothingSteps = 40;
// Runs other than the first prefer some squares of this edge, metres; in the other squares ways cost up to
// this factor more.
constexpr double kPreferenceM = 0.8;
constexpr double kPreferenceCost = 2;

class DrivePlanner {
 public:
  DrivePlanner(const Building& building, const SimulateOptions& options, uint64_t seed)
      : building_(building), options_(options), random_(seed) {
    const Rect& bounds = building.layout.bounds;
    cols_ = static_cast<int>(bounds.width() / kCellM);
    rows_ = static_cast<int>(bounds.depth() / kCellM);
    for (int cell = 0; cell < cols_ * rows_; ++cell) {
      const Eigen::Vector2d place = Place(cell);
      clearance_.push_back(ClearanceM(building, place.x(), place.y()));
      const auto square_x = static_cast<uint64_t>((place.x() - bounds.x0) / kPreferenceM);
      const auto square_y = static_cast<uint64_t>((place.y() - bounds.y0) / kPreferenceM);
      const double preference = Random(MixSeed(MixSeed(seed, square_x), square_y)).Uniform();
      way_cost_.push_back(options.run == 0 ? 1 : 1 + kPreferenceCost * preference);
    }
  }

  Result<std::vector<DrivePose>> Plan() {
    CAIRN_RETURN_IF_ERROR(ChoosePlaces());
    std::vector<Eigen::Vector2d> way = {Place(places_.front().cell)};
    int current = places_.front().cell;
    std::vector<char> is_left(clearance_.size(), 0);
    size_t num_left = 0;
    for (const PlaceToVisit& place : places_) {
      if (place.cell != current && !is_left[place.cell]) is_left[place.cell] = 1, ++num_left;
    }
    const int start = current;
    for (; num_left > 0; --num_left) {
      CAIRN_RETURN_IF_ERROR(Extend(is_left, &current, &way));
      is_left[current] = 0;
    }
    if (current != start) {
      is_left[start] = 1;
      CAIRN_RETURN_IF_ERROR(Extend(is_left, &current, &way));
    }
    Smooth(&way);
    return Sample(way);
  }

 private:
  struct PlaceToVisit {
    int cell = 0;
    size_t room = 0;
  };

  Eigen::Vector2d Place(int cell) const {
    const Rect& bounds = building_.layout.bounds;
    return {bounds.x0 + (cell % cols_ + 0.5) * kCellM, bounds.y0 + (cell / cols_ + 0.5) * kCellM};
  }

  bool IsFree(int cell) const { return clearance_[cell] >= options_.clearance_m; }

  // Chooses in every room the place with the most space, then further ones away from those chosen.
  Status ChoosePlaces() {
    for (size_t r = 0; r < building_.layout.rooms.size(); ++r) {
      const Room& room = building_.layout.rooms[r];
      std::vector<int> cells;
      for (int cell = 0; cell < cols_ * rows_; ++cell) {
        const Eigen::Vector2d place = Place(cell);
        if (IsFree(cell) && DistanceToRect(room.rect, place.x(), place.y()) == 0) cells.push_back(cell);
      }
      if (cells.empty()) {
        return MakeError(ErrorCode::kNoData,
                         "{} has no place with clearance_m = {:g}; use a smaller clearance or less furniture",
                         room.name, options_.clearance_m);
      }
      std::stable_sort(cells.begin(), cells.end(),
                       [&](int a, int b) { return clearance_[a] > clearance_[b]; });
      if (options_.run > 0) Shuffle(&cells);
      for (const int cell : cells) {
        const bool is_far = std::none_of(places_.begin(), places_.end(), [&](const PlaceToVisit& other) {
          return other.room == r && (Place(other.cell) - Place(cell)).norm() < kVisitSpacingM;
        });
        if (is_far) places_.push_back({cell, r});
      }
    }
    // The drive begins and ends at the first one.
    if (options_.run > 0) Shuffle(&places_);
    return Ok();
  }

  template <typename T>
  void Shuffle(std::vector<T>* values) {
    for (size_t k = values->size(); k > 1; --k) {
      std::swap((*values)[k - 1], (*values)[random_.UniformInt(0, static_cast<int64_t>(k) - 1)]);
    }
  }

  // Dijkstra from `*current` to the nearest cell of `goals`; appends the way.  Ties go to the smaller cell.
  Status Extend(const std::vector<char>& goals, int* current, std::vector<Eigen::Vector2d>* way) const {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    std::vector<double> cost(clearance_.size(), kInfinity);
    std::vector<int> previous(clearance_.size(), -1);
    using Entry = std::pair<double, int>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    cost[*current] = 0;
    queue.push({0, *current});
    while (!queue.empty()) {
      const auto [cell_cost, cell] = queue.top();
      queue.pop();
      if (cell_cost > cost[cell]) continue;
      if (goals[cell]) {
        const size_t begin = way->size();
        for (int c = cell; c != *current; c = previous[c]) way->push_back(Place(c));
        std::reverse(way->begin() + static_cast<std::ptrdiff_t>(begin), way->end());
        *current = cell;
        return Ok();
      }
      const int x = cell % cols_, y = cell / cols_;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          if ((dx == 0 && dy == 0) || x + dx < 0 || y + dy < 0 || x + dx >= cols_ || y + dy >= rows_)
            continue;
          const int next = cell + dy * cols_ + dx;
          if (!IsFree(next)) continue;
          const double crowding = kNearCost * std::max(0.0, kComfortM - clearance_[next]) / kComfortM;
          const double next_cost = cell_cost + kCellM * std::hypot(dx, dy) * way_cost_[next] * (1 + crowding);
          if (next_cost < cost[next]) {
            cost[next] = next_cost;
            previous[next] = cell;
            queue.push({next_cost, next});
          }
        }
      }
    }
    return MakeError(
        ErrorCode::kNoData,
        "not all rooms can be reached with clearance_m = {:g}; use a smaller clearance, wider doors or less "
        "furniture",
        options_.clearance_m);
  }

  // Pulls every point towards the middle of its neighbours as long as it keeps its clearance.
  void Smooth(std::vector<Eigen::Vector2d>* way) const {
    for (int step = 0; step < kSmoothingSteps; ++step) {
      for (size_t i = 1; i + 1 < way->size(); ++i) {
        const Eigen::Vector2d moved = 0.5 * (*way)[i] + 0.25 * ((*way)[i - 1] + (*way)[i + 1]);
        if (ClearanceM(building_, moved.x(), moved.y()) >= options_.clearance_m) (*way)[i] = moved;
      }
    }
  }

  // Poses every step_m along the way, and turns on the spot where it bends sharply.
  std::vector<DrivePose> Sample(const std::vector<Eigen::Vector2d>& way) const {
    std::vector<Eigen::Vector2d> points;
    double left = 0;  // way until the next point
    for (size_t i = 0; i + 1 < way.size(); ++i) {
      const Eigen::Vector2d step = way[i + 1] - way[i];
      const double length = step.norm();
      for (; left < length; left += options_.step_m) points.push_back(way[i] + left / length * step);
      left -= length;
    }
    const double max_turn_rad = options_.max_turn_deg * std::numbers::pi / 180;
    std::vector<DrivePose> poses;
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d ahead = points[std::min(i + 1, points.size() - 1)] - points[i > 0 ? i - 1 : 0];
      double heading = ahead.norm() > 1e-9 ? std::atan2(ahead.y(), ahead.x())
                                           : (poses.empty() ? 0.0 : poses.back().heading_rad);
      // Straight lines between points that keep their clearance may cut a corner: such a point is left out.
      if (ClearanceM(building_, points[i].x(), points[i].y()) < options_.clearance_m) continue;
      if (!poses.empty()) {
        const DrivePose before = poses.back();
        const double turn = std::remainder(heading - before.heading_rad, 2 * std::numbers::pi);
        const int num_turns = static_cast<int>(std::abs(turn) / max_turn_rad);
        for (int t = 1; t <= num_turns; ++t) {
          poses.push_back({before.position, before.heading_rad + turn * t / (num_turns + 1)});
        }
        heading = before.heading_rad + turn;
      }
      poses.push_back({points[i], heading});
    }
    return poses;
  }

  const Building& building_;
  const SimulateOptions& options_;
  Random random_;
  int cols_ = 0, rows_ = 0;
  std::vector<double> clearance_;  // per cell
  std::vector<double> way_cost_;   // per cell: cost of a metre there, besides the cost of its clearance
  std::vector<PlaceToVisit> places_;
};

}  // namespace

Result<std::vector<DrivePose>> PlanDrive(const Building& building, const SimulateOptions& options,
                                         uint64_t seed) {
  return DrivePlanner(building, options, MixSeed(seed, 12)).Plan();
}

}  // namespace cairn::sim
