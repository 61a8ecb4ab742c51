#include "runtime/paths/plan_space.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

int Sign(int64_t value) { return value > 0 ? 1 : value < 0 ? -1 : 0; }

// Whether two closed segments, or points, have a point in common.  Exact.
bool Meet(const GridPoint& a, const GridPoint& b, const GridPoint& c, const GridPoint& d) {
  const auto apart = [](int64_t from, int64_t to, int64_t other_from, int64_t other_to) {
    return std::max(from, to) < std::min(other_from, other_to) ||
           std::max(other_from, other_to) < std::min(from, to);
  };
  if (apart(a.x, b.x, c.x, d.x) || apart(a.y, b.y, c.y, d.y)) return false;
  return Sign(Orientation(a, b, c)) * Sign(Orientation(a, b, d)) <= 0 &&
         Sign(Orientation(c, d, a)) * Sign(Orientation(c, d, b)) <= 0;
}

// Whether a direction from `origin` lies in the upper half of the plane, +x included and -x not.
bool IsUpper(const GridPoint& origin, const GridPoint& to) {
  return to.y > origin.y || (to.y == origin.y && to.x > origin.x);
}

// What lies on the straight way of a point from a to b.  Places are measured along it.
class StraightWay {
 public:
  StraightWay(const GridPoint& a, const GridPoint& b)
      : a_(a), b_(b), along_x_(std::abs(b.x - a.x) >= std::abs(b.y - a.y)), end_(Along(b)) {}

  // False where the piece crosses the way.
  bool Add(const GridPoint& start, const GridPoint& end) {
    const int start_side = Sign(Orientation(a_, b_, start)), end_side = Sign(Orientation(a_, b_, end));
    if (start_side * end_side < 0)
      return Sign(Orientation(start, end, a_)) * Sign(Orientation(start, end, b_)) >= 0;
    if (start_side == 0) AddJoint(Along(start), end_side);
    if (end_side == 0) AddJoint(Along(end), start_side);
    if (start_side == 0 && end_side == 0) walls_.push_back(std::minmax(Along(start), Along(end)));
    return true;
  }

  Passage Passed() {
    std::sort(joints_.begin(), joints_.end());
    Passage passage;
    if (HasWall(0, joints_.empty() ? end_ : joints_[0].first)) {
      passage = {kLeftSide, kRightSide};
    } else {
      passage = {kEitherSide, kEitherSide};
    }
    for (size_t i = 0; i < joints_.size();) {
      const int64_t at = joints_[i].first;
      unsigned open = kEitherSide;
      for (; i < joints_.size() && joints_[i].first == at; ++i) {
        if (joints_[i].second > 0) open &= ~unsigned{kLeftSide};
        if (joints_[i].second < 0) open &= ~unsigned{kRightSide};
      }
      const bool wall_follows = HasWall(at, i < joints_.size() ? joints_[i].first : end_);
      for (unsigned* sides : {&passage.from_left, &passage.from_right}) {
        *sides &= open;
        if (*sides != 0 && !wall_follows) *sides = kEitherSide;
      }
    }
    return passage;
  }

 private:
  int64_t Along(const GridPoint& point) const {
    return along_x_ ? Sign(b_.x - a_.x) * (point.x - a_.x) : Sign(b_.y - a_.y) * (point.y - a_.y);
  }
  void AddJoint(int64_t at, int side) {
    if (at > 0 && at < end_) joints_.emplace_back(at, side);
  }
  bool HasWall(int64_t from, int64_t to) const {
    return std::any_of(walls_.begin(), walls_.end(),
                       [&](const auto& wall) { return wall.first <= from && wall.second >= to; });
  }

  const GridPoint a_, b_;
  const bool along_x_;
  const int64_t end_;
  // Vertices between a and b, each with the side on which a piece leaves it; 0: along the way.
  std::vector<std::pair<int64_t, int>> joints_;
  std::vector<std::pair<int64_t, int64_t>> walls_;  // along the way
};

}  // namespace

// [Simsarian96 §4.1] The region adjacency graph, with the middles of common borders.
void PlanSpace::ListNeighbours() {
  for (const ViewLink& link : views_.links) {
    ++neighbour_offsets_[link.a + 1];
    ++neighbour_offsets_[link.b + 1];
  }
  for (FaceIdx face = 0; face < views_.num_faces(); ++face)
    neighbour_offsets_[face + 1] += neighbour_offsets_[face];
  neighbours_.resize(neighbour_offsets_.back());
  std::vector<int64_t> next(neighbour_offsets_.begin(), neighbour_offsets_.end() - 1);
  for (const ViewLink& link : views_.links) {
    const Vec2 middle = 0.5 * (views_.plan.Metres(views_.vertices[link.start]) +
                               views_.plan.Metres(views_.vertices[link.end]));
    neighbours_[next[link.a]++] = {link.b, middle};
    neighbours_[next[link.b]++] = {link.a, middle};
  }
}

Status PlanSpace::CheckInside(const Eigen::Vector2d& place) const {
  if (FaceAt(place) >= 0) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "the place ({:g}, {:g}) lies in no region of the plan",
                   place.x(), place.y());
}

std::vector<VisibleStretch> PlanSpace::ViewFrom(const Vec2& place) const {
  const FaceIdx face = FaceAt(place);
  if (face < 0) return {};
  return VisibleStretches(views_.plan, views_.LabelSet(face), place);
}

void PlanSpace::ListPieces() {
  const FloorPlan& plan = views_.plan;
  low_ = plan.Metres(plan.low);
  const Vec2 size = (plan.Metres(plan.high) - low_).cwiseMax(1e-3);
  const double num_pieces = std::max(1.0, static_cast<double>(plan.pieces.size()));
  cell_m_ = std::max(std::sqrt(size.x() * size.y() / num_pieces), size.maxCoeff() / 1024);
  num_columns_ = static_cast<int>(size.x() / cell_m_) + 1;
  num_rows_ = static_cast<int>(size.y() / cell_m_) + 1;
  cell_pieces_.resize(static_cast<size_t>(num_columns_) * num_rows_);
  for (const PlanPiece& piece : plan.pieces) {
    const GridPoint &start = plan.vertices[piece.start], &end = plan.vertices[piece.end];
    VisitCells(plan.Metres(start), plan.Metres(end), CellMargin(), [&](size_t cell) {
      cell_pieces_[cell].push_back({start, end});
      return true;
    });
  }
}

void PlanSpace::ListCorners() {
  const FloorPlan& plan = views_.plan;
  struct Arm {
    GridPoint end;
    bool leaves;  // in the direction of its wall
  };
  std::map<GridPoint, std::vector<Arm>> arms_of;
  for (const PlanPiece& piece : plan.pieces) {
    const GridPoint &start = plan.vertices[piece.start], &end = plan.vertices[piece.end];
    arms_of[start].push_back({end, true});
    arms_of[end].push_back({start, false});
  }
  for (auto& [vertex, arms] : arms_of) {
    std::sort(arms.begin(), arms.end(), [&vertex = vertex](const Arm& a, const Arm& b) {
      const bool upper_a = IsUpper(vertex, a.end), upper_b = IsUpper(vertex, b.end);
      if (upper_a != upper_b) return upper_a;
      return Orientation(vertex, a.end, b.end) > 0;
    });
    for (size_t i = 0; i < arms.size(); ++i) {
      const Arm &first = arms[i], &last = arms[(i + 1) % arms.size()];
      // In closed plans the domain lies left of walls.
      if (plan.closed && !first.leaves) continue;
      gaps_.push_back({vertex, first.end, last.end});
      if (arms.size() == 1 || Orientation(vertex, first.end, last.end) < 0) corners_.push_back(gaps_.back());
    }
  }
}

double PlanSpace::CellMargin() const { return std::max(1e-3, views_.plan.grid_m); }

std::optional<GridPoint> PlanSpace::OnGrid(const Vec2& place) const {
  const FloorPlan& plan = views_.plan;
  const Vec2 point = plan.Grid(place).array().round();
  if (!(point.array().abs() <= static_cast<double>(kMaxGridCoordinate)).all()) return std::nullopt;
  const GridPoint on_grid{static_cast<int64_t>(point.x()), static_cast<int64_t>(point.y())};
  if (on_grid.x < plan.low.x || on_grid.y < plan.low.y || on_grid.x > plan.high.x || on_grid.y > plan.high.y)
    return std::nullopt;
  return on_grid;
}

template <typename Visit>
bool PlanSpace::VisitCells(const Vec2& a, const Vec2& b, double radius_m, Visit&& visit) const {
  const auto column = [&](double x) {
    return std::clamp(static_cast<int>((x - low_.x()) / cell_m_), 0, num_columns_ - 1);
  };
  const auto row = [&](double y) {
    return std::clamp(static_cast<int>((y - low_.y()) / cell_m_), 0, num_rows_ - 1);
  };
  const Vec2 &left = a.x() <= b.x() ? a : b, &right = a.x() <= b.x() ? b : a;
  const double slope = right.x() > left.x() ? (right.y() - left.y()) / (right.x() - left.x()) : 0;
  for (int c = column(left.x() - radius_m); c <= column(right.x() + radius_m); ++c) {
    double from = std::min(a.y(), b.y()), to = std::max(a.y(), b.y());
    if (right.x() - left.x() > 1e-9) {
      const double x0 = std::clamp(low_.x() + c * cell_m_ - radius_m, left.x(), right.x());
      const double x1 = std::clamp(low_.x() + (c + 1) * cell_m_ + radius_m, left.x(), right.x());
      const double y0 = left.y() + slope * (x0 - left.x()), y1 = left.y() + slope * (x1 - left.x());
      from = std::min(y0, y1);
      to = std::max(y0, y1);
    }
    for (int r = row(from - radius_m); r <= row(to + radius_m); ++r) {
      if (!visit(static_cast<size_t>(r) * num_columns_ + c)) return false;
    }
  }
  return true;
}

bool PlanSpace::IsFree(const Vec2& a, const Vec2& b, double radius_m) const {
  const std::optional<GridPoint> from = OnGrid(a), to = OnGrid(b);
  if (!from || !to) return false;
  const FloorPlan& plan = views_.plan;
  const Vec2 along = b - a;
  return VisitCells(a, b, radius_m + CellMargin(), [&](size_t cell) {
    for (const CellPiece& piece : cell_pieces_[cell]) {
      if (radius_m <= 0) {
        if (Meet(*from, *to, piece.start, piece.end)) return false;
        continue;
      }
      const Vec2 start = plan.Metres(piece.start), end = plan.Metres(piece.end);
      const double side_start = Cross(along, start - a), side_end = Cross(along, end - a);
      const double side_a = Cross(end - start, a - start), side_b = Cross(end - start, b - start);
      if (side_start * side_end < 0 && side_a * side_b < 0) return false;
      const double nearest = std::min({PointToSegment(a, start, end), PointToSegment(b, start, end),
                                       PointToSegment(start, a, b), PointToSegment(end, a, b)});
      if (nearest < radius_m) return false;
    }
    return true;
  });
}

Passage PlanSpace::PassageBetween(const Vec2& a, const Vec2& b) const {
  const std::optional<GridPoint> from = OnGrid(a), to = OnGrid(b);
  if (!from || !to) return {};
  if (*from == *to) return {kEitherSide, kEitherSide};
  StraightWay way(*from, *to);
  const bool crosses_none = VisitCells(a, b, CellMargin(), [&](size_t cell) {
    return std::all_of(cell_pieces_[cell].begin(), cell_pieces_[cell].end(),
                       [&](const CellPiece& piece) { return way.Add(piece.start, piece.end); });
  });
  return crosses_none ? way.Passed() : Passage{};
}

double PlanSpace::Clearance(const Vec2& place) const {
  const FloorPlan& plan = views_.plan;
  double nearest = std::numeric_limits<double>::infinity();
  for (const PlanPiece& piece : plan.pieces) {
    nearest = std::min(nearest, PointToSegment(place, plan.Metres(plan.vertices[piece.start]),
                                               plan.Metres(plan.vertices[piece.end])));
  }
  return nearest;
}

}  // namespace cairn
