#include "runtime/paths/floor_pieces.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
// Smaller pieces are left out, m2.
constexpr double kLeastArea = 1e-10;

// Sweeps an upright line over a plan: between two neighbouring vertices in x, neighbouring pieces of walls
// along the line bound trapezoids, which go on as long as both pieces do and no upright wall comes between.
class TrapezoidSweep {
 public:
  explicit TrapezoidSweep(const FloorPlan& plan) : plan_(plan) {
    for (int32_t i = 0; i < static_cast<int32_t>(plan.pieces.size()); ++i) {
      const auto [left, right] = Ends(i);
      begin_at_[left.x].push_back(i);
      begin_at_[right.x];
    }
    begin_at_[plan.low.x];
    begin_at_[plan.high.x];
  }

  std::vector<ConvexPiece> Run() {
    std::vector<int32_t> across;
    for (auto column = begin_at_.begin(); std::next(column) != begin_at_.end(); ++column) {
      const int64_t x = column->first, next_x = std::next(column)->first;
      std::erase_if(across, [&](int32_t piece) { return Ends(piece).second.x <= x; });
      std::vector<std::pair<double, double>> upright;
      for (const int32_t piece : column->second) {
        const auto [low, high] = Ends(piece);
        if (low.x == high.x) {
          upright.emplace_back(low.y, high.y);
        } else {
          across.push_back(piece);
        }
      }
      const double middle = 0.5 * (static_cast<double>(x) + static_cast<double>(next_x));
      std::sort(across.begin(), across.end(), [&](int32_t a, int32_t b) {
        return std::pair(HeightAt(a, middle), a) < std::pair(HeightAt(b, middle), b);
      });
      Advance(static_cast<double>(x), across, upright);
    }
    for (const auto& [pair, begin] : begun_) Add(pair, begin, static_cast<double>(begin_at_.rbegin()->first));
    return std::move(pieces_);
  }

 private:
  static constexpr int32_t kBottom = -1, kTop = -2;
  using Bounds = std::pair<int32_t, int32_t>;  // the pieces below and above

  std::pair<GridPoint, GridPoint> Ends(int32_t piece) const {
    const GridPoint &a = plan_.vertices[plan_.pieces[piece].start],
                    &b = plan_.vertices[plan_.pieces[piece].end];
    return a < b ? std::pair(a, b) : std::pair(b, a);
  }

  double HeightAt(int32_t piece, double x) const {
    if (piece == kBottom) return static_cast<double>(plan_.low.y);
    if (piece == kTop) return static_cast<double>(plan_.high.y);
    const auto [left, right] = Ends(piece);
    const Vec2 from = Real(left), to = Real(right);
    if (x == to.x()) return to.y();
    return from.y() + (to.y() - from.y()) * ((x - from.x()) / (to.x() - from.x()));
  }

  // Ends the trapezoids that do not go on beyond x, and begins those that are new there.
  void Advance(double x, const std::vector<int32_t>& across,
               const std::vector<std::pair<double, double>>& upright) {
    std::vector<Bounds> bounds;
    for (size_t i = 0; i <= across.size(); ++i)
      bounds.emplace_back(i > 0 ? across[i - 1] : kBottom, i < across.size() ? across[i] : kTop);
    const auto is_cut = [&](const Bounds& pair) {
      const double low = HeightAt(pair.first, x), high = HeightAt(pair.second, x);
      return std::any_of(upright.begin(), upright.end(),
                         [&](const auto& wall) { return wall.first < high && wall.second > low; });
    };
    std::map<Bounds, double> now;
    for (const Bounds& pair : bounds) {
      const auto before = begun_.find(pair);
      const bool goes_on = before != begun_.end() && !is_cut(pair);
      now[pair] = goes_on ? before->second : x;
      if (goes_on) begun_.erase(before);
    }
    for (const auto& [pair, begin] : begun_) Add(pair, begin, x);
    begun_ = std::move(now);
  }

  void Add(const Bounds& pair, double from, double to) {
    ConvexPiece piece;
    for (const auto& [x, bound] : {std::pair(from, pair.first), std::pair(to, pair.first),
                                   std::pair(to, pair.second), std::pair(from, pair.second)}) {
      const Vec2 corner = plan_.Metres(x, HeightAt(bound, x));
      if (piece.empty() || (corner != piece.back() && corner != piece.front())) piece.push_back(corner);
    }
    if (piece.size() >= 3 && AreaOf(piece) > kLeastArea) pieces_.push_back(std::move(piece));
  }

  const FloorPlan& plan_;
  std::map<int64_t, std::vector<int32_t>> begin_at_;  // pieces by the x of their left end; each x of a vertex
  std::map<Bounds, double> begun_;
  std::vector<ConvexPiece> pieces_;
};

}  // namespace

double AreaOf(const ConvexPiece& piece) {
  double twice = 0;
  for (size_t i = 1; i + 1 < piece.size(); ++i) twice += Cross(piece[i] - piece[0], piece[i + 1] - piece[0]);
  return 0.5 * twice;
}

double AreaOf(const std::vector<ConvexPiece>& pieces) {
  double area = 0;
  for (const ConvexPiece& piece : pieces) area += AreaOf(piece);
  return area;
}

Vec2 CentroidOf(const ConvexPiece& piece) {
  Vec2 sum = Vec2::Zero();
  double twice = 0;
  for (size_t i = 1; i + 1 < piece.size(); ++i) {
    const double area = Cross(piece[i] - piece[0], piece[i + 1] - piece[0]);
    twice += area;
    sum += area * ((piece[i] - piece[0]) + (piece[i + 1] - piece[0])) / 3;
  }
  return twice > 0 ? Vec2(piece[0] + sum / twice) : piece[0];
}

ConvexPiece LeftOf(const ConvexPiece& piece, const Vec2& point, const Vec2& direction) {
  ConvexPiece left;
  for (size_t i = 0; i < piece.size(); ++i) {
    const Vec2 &a = piece[i], &b = piece[(i + 1) % piece.size()];
    const double side_a = Cross(direction, a - point), side_b = Cross(direction, b - point);
    if (side_a >= 0) left.push_back(a);
    if ((side_a > 0 && side_b < 0) || (side_a < 0 && side_b > 0))
      left.push_back(a + side_a / (side_a - side_b) * (b - a));
  }
  if (left.size() < 3) left.clear();
  return left;
}

std::vector<ConvexPiece> Divided(const std::vector<ConvexPiece>& pieces, double size_m) {
  std::vector<ConvexPiece> small, rest(pieces.rbegin(), pieces.rend());
  while (!rest.empty()) {
    const ConvexPiece piece = std::move(rest.back());
    rest.pop_back();
    Vec2 low = piece[0], high = piece[0];
    for (const Vec2& corner : piece) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
    const Vec2 size = high - low;
    if (size.maxCoeff() <= size_m) {
      small.push_back(piece);
      continue;
    }
    const Vec2 across = size.x() > size.y() ? Vec2(0, 1) : Vec2(1, 0);
    for (const Vec2& direction : {across, Vec2(-across)}) {
      ConvexPiece half = LeftOf(piece, 0.5 * (low + high), direction);
      if (half.size() >= 3 && AreaOf(half) > kLeastArea) rest.push_back(std::move(half));
    }
  }
  return small;
}

std::vector<ConvexPiece> FloorPieces(const PlanSpace& space) {
  const FloorPlan& plan = space.views().plan;
  std::vector<ConvexPiece> pieces = TrapezoidSweep(plan).Run();
  if (plan.closed) {
    std::erase_if(pieces, [&](const ConvexPiece& piece) { return space.FaceAt(CentroidOf(piece)) < 0; });
  }
  return pieces;
}

LookAround::LookAround(const PlanSpace& space, const Vec2& place) : place_(place) {
  const FloorPlan& plan = space.views().plan;
  std::vector<BlockedArc> arcs;
  for (const PlanPiece& piece : plan.pieces) {
    AppendArcs(plan.Metres(plan.vertices[piece.start]) - place, plan.Metres(plan.vertices[piece.end]) - place,
               0, 0, &arcs);
  }
  // Around the box, for there to be something in each direction also from its border.
  constexpr double kMarginM = 1e-3;
  const Vec2 low = plan.Metres(plan.low).array() - kMarginM, high = plan.Metres(plan.high).array() + kMarginM;
  const Vec2 right(high.x(), low.y()), left(low.x(), high.y());
  for (const auto& [start, end] :
       {std::pair(low, right), std::pair(right, high), std::pair(high, left), std::pair(left, low)})
    AppendArcs(start - place, end - place, 0, 0, &arcs);
  arcs_ = NearestArcs(std::move(arcs));
}

bool LookAround::Sees(const Vec2& point) const {
  const Vec2 to = point - place_;
  const double angle = AngleOf(to);
  const auto arc = FirstArcFrom(arcs_, angle);
  return arc != arcs_.end() && to.norm() <= arc->Distance(angle);
}

std::vector<ConvexPiece> LookAround::Hidden(const std::vector<ConvexPiece>& pieces) const {
  std::vector<ConvexPiece> hidden;
  for (const ConvexPiece& piece : pieces) AddHidden(piece, &hidden);
  return hidden;
}

void LookAround::AddHidden(const ConvexPiece& piece, std::vector<ConvexPiece>* hidden) const {
  ConvexPiece moved;
  for (const Vec2& corner : piece) moved.push_back(corner - place_);
  bool is_inside = true;
  for (size_t i = 0; i < moved.size(); ++i)
    is_inside &= Cross(moved[(i + 1) % moved.size()] - moved[i], -moved[i]) >= 0;
  std::vector<ConvexPiece> parts;
  double area = 0;
  const auto cut = [&](const BlockedArc& arc) {
    // Right of start -> end lies what is behind it.
    ConvexPiece part = LeftOf(moved, arc.start, arc.start - arc.end);
    if (part.empty()) return;
    part = LeftOf(part, Vec2::Zero(), {std::cos(arc.from), std::sin(arc.from)});
    part = LeftOf(part, Vec2::Zero(), {-std::cos(arc.to), -std::sin(arc.to)});
    const double part_area = AreaOf(part);
    if (part_area <= kLeastArea) return;
    area += part_area;
    for (Vec2& corner : part) corner += place_;
    parts.push_back(std::move(part));
  };
  if (is_inside) {
    for (const BlockedArc& arc : arcs_) cut(arc);
  } else {
    const double middle = AngleOf(CentroidOf(moved));
    double first = 0, last = 0;  // from there
    for (const Vec2& corner : moved) {
      const double turn = std::remainder(AngleOf(corner) - middle, 2 * std::numbers::pi);
      first = std::min(first, turn);
      last = std::max(last, turn);
    }
    const auto cut_between = [&](double from, double to) {
      for (auto arc = FirstArcFrom(arcs_, from); arc != arcs_.end() && arc->from <= to; ++arc) cut(*arc);
    };
    const double from = middle + first, to = middle + last;
    if (from < -std::numbers::pi) cut_between(from + 2 * std::numbers::pi, std::numbers::pi);
    if (to > std::numbers::pi) cut_between(-std::numbers::pi, to - 2 * std::numbers::pi);
    cut_between(std::max(from, -std::numbers::pi), std::min(to, std::numbers::pi));
  }
  // Pieces that are wholly hidden stay whole.
  if (area >= (1 - 1e-9) * AreaOf(piece)) {
    hidden->push_back(piece);
  } else {
    hidden->insert(hidden->end(), parts.begin(), parts.end());
  }
}

}  // namespace cairn
