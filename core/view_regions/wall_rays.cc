#include "core/view_regions/wall_rays.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
// Cells take up pieces that come this close, grid units: more than rounding can move a ray.
constexpr double kSlack = 2;
constexpr double kPiecesPerCell = 0.5;
constexpr int kMaxCellsPerSide = 2048;

// A ratio of numbers below 2^62 with a positive denominator.
struct Ratio {
  int64_t numerator = 0, denominator = 1;
  bool operator<(const Ratio& other) const {
    return static_cast<__int128>(numerator) * other.denominator <
           static_cast<__int128>(other.numerator) * denominator;
  }
  double Value() const { return static_cast<double>(numerator) / static_cast<double>(denominator); }
};

}  // namespace

WallRays::WallRays(const FloorPlan& plan) : plan_(plan), at_vertex_(plan.vertices.size()) {
  low_ = Vec2(static_cast<double>(plan.low.x), static_cast<double>(plan.low.y)).array() - 2 * kSlack;
  high_ = Vec2(static_cast<double>(plan.high.x), static_cast<double>(plan.high.y)).array() + 2 * kSlack;
  const Vec2 size = high_ - low_;
  cell_ = std::sqrt(size.x() * size.y() * kPiecesPerCell / std::max<size_t>(1, plan.pieces.size()));
  cell_ = std::max({cell_, size.maxCoeff() / kMaxCellsPerSide, 16.0});
  num_columns_ = static_cast<int>(size.x() / cell_) + 1;
  num_rows_ = static_cast<int>(size.y() / cell_) + 1;
  std::vector<std::vector<int32_t>> cells(static_cast<size_t>(num_columns_) * num_rows_);
  for (size_t i = 0; i < plan.pieces.size(); ++i) {
    const PlanPiece& piece = plan.pieces[i];
    at_vertex_[piece.start].push_back(static_cast<int32_t>(i));
    at_vertex_[piece.end].push_back(static_cast<int32_t>(i));
    const GridPoint &a = plan.vertices[piece.start], &b = plan.vertices[piece.end];
    const Vec2 start(static_cast<double>(a.x), static_cast<double>(a.y));
    const Vec2 along = Vec2(static_cast<double>(b.x), static_cast<double>(b.y)) - start;
    const Vec2 end = start + along;
    const auto column = [&](double x) {
      return std::clamp(static_cast<int>((x - low_.x()) / cell_), 0, num_columns_ - 1);
    };
    const auto row = [&](double y) {
      return std::clamp(static_cast<int>((y - low_.y()) / cell_), 0, num_rows_ - 1);
    };
    for (int c = column(std::min(start.x(), end.x()) - kSlack);
         c <= column(std::max(start.x(), end.x()) + kSlack); ++c) {
      // The part of the piece above this column.
      double from = std::min(start.y(), end.y()), to = std::max(start.y(), end.y());
      if (std::abs(along.x()) > 1) {
        const double x0 = low_.x() + c * cell_ - kSlack, x1 = x0 + cell_ + 2 * kSlack;
        const double y0 =
            start.y() +
            (std::clamp(x0, std::min(start.x(), end.x()), std::max(start.x(), end.x())) - start.x()) /
                along.x() * along.y();
        const double y1 =
            start.y() +
            (std::clamp(x1, std::min(start.x(), end.x()), std::max(start.x(), end.x())) - start.x()) /
                along.x() * along.y();
        from = std::max(from, std::min(y0, y1));
        to = std::min(to, std::max(y0, y1));
      }
      for (int r = row(from - kSlack); r <= row(to + kSlack); ++r)
        cells[static_cast<size_t>(r) * num_columns_ + c].push_back(static_cast<int32_t>(i));
    }
  }
  cell_offsets_.push_back(0);
  for (const std::vector<int32_t>& cell : cells) {
    cell_pieces_.insert(cell_pieces_.end(), cell.begin(), cell.end());
    cell_offsets_.push_back(static_cast<int32_t>(cell_pieces_.size()));
  }
}

template <typename Visit>
void WallRays::Walk(const Vec2& origin, const Vec2& direction, double t_end, Visit&& visit) const {
  int column = std::clamp(static_cast<int>((origin.x() - low_.x()) / cell_), 0, num_columns_ - 1);
  int row = std::clamp(static_cast<int>((origin.y() - low_.y()) / cell_), 0, num_rows_ - 1);
  const int step_x = direction.x() > 0 ? 1 : -1, step_y = direction.y() > 0 ? 1 : -1;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto t_at_column = [&](int c) {
    return direction.x() == 0 ? kInfinity
                              : (low_.x() + (c + (step_x > 0)) * cell_ - origin.x()) / direction.x();
  };
  const auto t_at_row = [&](int r) {
    return direction.y() == 0 ? kInfinity
                              : (low_.y() + (r + (step_y > 0)) * cell_ - origin.y()) / direction.y();
  };
  double next_x = t_at_column(column), next_y = t_at_row(row);
  // In units of t: how far rounding may move a hit out of its cell.
  const double slack = kSlack / direction.norm();
  double best = kInfinity;
  while (column >= 0 && row >= 0 && column < num_columns_ && row < num_rows_) {
    const size_t cell = static_cast<size_t>(row) * num_columns_ + column;
    for (int32_t i = cell_offsets_[cell]; i < cell_offsets_[cell + 1]; ++i)
      best = std::min(best, visit(cell_pieces_[i]));
    const double t = std::min(next_x, next_y);
    if (best < t - slack || t > t_end + slack) return;
    if (next_x < next_y) {
      column += step_x;
      next_x = t_at_column(column);
    } else {
      row += step_y;
      next_y = t_at_row(row);
    }
  }
}

WallRays::Hit WallRays::Beyond(int32_t through, int32_t from) const {
  const GridPoint &q = plan_.vertices[through], &p = plan_.vertices[from];
  const int64_t dx = p.x - q.x, dy = p.y - q.y;
  const Vec2 origin(static_cast<double>(p.x), static_cast<double>(p.y));
  const Vec2 direction(static_cast<double>(dx), static_cast<double>(dy));
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Hit hit;
  Ratio nearest{1, 0};
  const int64_t squared = dx * dx + dy * dy;
  Walk(origin, direction, kInfinity, [&](int32_t index) {
    const PlanPiece& piece = plan_.pieces[index];
    const GridPoint &a = plan_.vertices[piece.start], &b = plan_.vertices[piece.end];
    const int64_t left_a = dx * (a.y - p.y) - dy * (a.x - p.x), left_b = dx * (b.y - p.y) - dy * (b.x - p.x);
    double t = kInfinity;
    for (const auto& [vertex, left] : {std::pair{piece.start, left_a}, std::pair{piece.end, left_b}}) {
      const GridPoint& v = plan_.vertices[vertex];
      const int64_t ahead = dx * (v.x - p.x) + dy * (v.y - p.y);
      if (left != 0 || ahead <= 0) continue;
      const Ratio ratio{ahead, squared};
      t = std::min(t, ratio.Value());
      if (nearest.denominator == 0 || ratio < nearest) {
        nearest = ratio;
        hit.vertex = vertex;
        hit.piece = -1;
      }
    }
    if ((left_a > 0 && left_b < 0) || (left_a < 0 && left_b > 0)) {
      // p + t (dx, dy) on ab:  t = cross(a - p, b - a) / cross(d, b - a)
      int64_t numerator = (a.x - p.x) * (b.y - a.y) - (a.y - p.y) * (b.x - a.x);
      int64_t denominator = dx * (b.y - a.y) - dy * (b.x - a.x);
      if (denominator < 0) {
        numerator = -numerator;
        denominator = -denominator;
      }
      if (numerator <= 0) return t;
      const Ratio ratio{numerator, denominator};
      t = ratio.Value();
      if (nearest.denominator == 0 || ratio < nearest) {
        nearest = ratio;
        hit.vertex = -1;
        hit.piece = index;
      }
    }
    return t;
  });
  if (!hit.none()) hit.place = origin + nearest.Value() * direction;
  return hit;
}

// [Simsarian96 §2] "visible": nothing between two vertices.
bool WallRays::Free(int32_t from, int32_t to) const {
  const GridPoint &p = plan_.vertices[from], &q = plan_.vertices[to];
  const int64_t dx = q.x - p.x, dy = q.y - p.y;
  const int64_t squared = dx * dx + dy * dy;
  const Vec2 origin(static_cast<double>(p.x), static_cast<double>(p.y));
  bool free = true;
  Walk(origin, Vec2(static_cast<double>(dx), static_cast<double>(dy)), 1.0, [&](int32_t index) {
    constexpr double kStop = -std::numeric_limits<double>::infinity();
    constexpr double kGoOn = std::numeric_limits<double>::infinity();
    const PlanPiece& piece = plan_.pieces[index];
    const GridPoint &a = plan_.vertices[piece.start], &b = plan_.vertices[piece.end];
    const int64_t left_a = dx * (a.y - p.y) - dy * (a.x - p.x), left_b = dx * (b.y - p.y) - dy * (b.x - p.x);
    if ((left_a > 0 && left_b > 0) || (left_a < 0 && left_b < 0)) return kGoOn;
    for (const auto& [vertex, left] : {std::pair{piece.start, left_a}, std::pair{piece.end, left_b}}) {
      const GridPoint& v = plan_.vertices[vertex];
      const int64_t ahead = dx * (v.x - p.x) + dy * (v.y - p.y);
      if (left == 0 && ahead > 0 && ahead < squared) {
        free = false;
        return kStop;
      }
    }
    if ((left_a > 0 && left_b < 0) || (left_a < 0 && left_b > 0)) {
      const int64_t side_p = Orientation(a, b, p), side_q = Orientation(a, b, q);
      if ((side_p > 0 && side_q < 0) || (side_p < 0 && side_q > 0)) {
        free = false;
        return kStop;
      }
    }
    return kGoOn;
  });
  return free;
}

LabelIdx WallRays::Look(const Vec2& origin, const Vec2& direction, double* distance) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double nearest = kInfinity;
  LabelIdx label = -1;
  Walk(origin, direction, kInfinity, [&](int32_t index) {
    const PlanPiece& piece = plan_.pieces[index];
    const GridPoint &a = plan_.vertices[piece.start], &b = plan_.vertices[piece.end];
    const Vec2 start = Vec2(static_cast<double>(a.x), static_cast<double>(a.y)) - origin;
    const Vec2 end = Vec2(static_cast<double>(b.x), static_cast<double>(b.y)) - origin;
    const double left_a = Cross(direction, start), left_b = Cross(direction, end);
    if ((left_a > 0) == (left_b > 0)) return kInfinity;
    const double t = Cross(start, end - start) / Cross(direction, end - start);
    if (t <= 0) return kInfinity;
    if (t < nearest) {
      nearest = t;
      // Seen against its direction from the right: the origin lies left of the piece if start -> end
      // turns so.
      label = LabelOf(piece.wall, Cross(start, end) < 0);
    }
    return t;
  });
  if (distance != nullptr) *distance = nearest;
  return label;
}

}  // namespace cairn
