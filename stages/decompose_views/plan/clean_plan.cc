#include "stages/decompose_views/plan/clean_plan.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "core/base/progress.h"
#include "core/plan/wall_cells.h"
#include "core/view_regions/derive_views.h"
#include "core/view_regions/node_segments.h"
#include "stages/decompose_views/plan/check_rings.h"
#include "stages/decompose_views/plan/join_walls.h"

namespace cairn::decompose_views {
namespace {

constexpr int kNumThreads = 1;

using Vec2 = Eigen::Vector2d;

// A wall in grid coordinates.
struct Wall {
  GridPoint start, end;
  int line = 0;
  std::vector<GridPoint> through;  // ends of other walls on it: it bends to go through them
};

// The walls that lie near to a place.
class WallsNear {
 public:
  // `reach`: how near they are all found, in units of the grid.
  WallsNear(const std::vector<Wall>& walls, double reach) {
    std::vector<PlanWall> lines;
    for (const Wall& wall : walls) lines.push_back({Real(wall.start), Real(wall.end)});
    grid_ = GridAround(lines, reach, 2 * reach, std::max<double>(kLeastNumCells, 2.0 * lines.size()));
    by_cell_ = WallsByCell(grid_, lines, reach);
  }

  // Ascending.  REQUIRES: an end that one of the walls had when this was made
  std::span<const int32_t> At(const GridPoint& place) const {
    const Eigen::Vector2i cell = grid_.CellOf(Real(place));
    return by_cell_.At(grid_.Index(cell.x(), cell.y()));
  }

 private:
  static constexpr double kLeastNumCells = 1024;

  CellGrid grid_;
  WallsByCell by_cell_;
};

// Cleans a plan; keeps its frame and the list of changes.
class Cleaner {
 public:
  Cleaner(const InputPlan& input, const CleanPlanOptions& options, Progress& progress)
      : input_(input), options_(options), progress_(progress) {}

  Result<CleanPlanResult> Run() {
    CAIRN_RETURN_IF_ERROR(TakeWalls());
    if (!input_.closed()) {
      CAIRN_RETURN_IF_ERROR(SnapEndsTogether());
      CAIRN_RETURN_IF_ERROR(SnapEndsOntoWalls());
    }
    DropDuplicates();
    if (walls_.empty()) {
      return MakeError(ErrorCode::kNoData, "no wall is left: all are shorter than the tolerances");
    }
    CAIRN_RETURN_IF_ERROR(Divide());
    result_.plan.closed = input_.closed();
    if (input_.closed()) CAIRN_RETURN_IF_ERROR(CheckCleanedRings());
    SetDomain();
    std::stable_sort(result_.changes.begin(), result_.changes.end(),
                     [](const PlanChange& a, const PlanChange& b) {
                       return std::tie(a.kind, a.line) < std::tie(b.kind, b.line);
                     });
    return std::move(result_);
  }

 private:
  void Note(PlanChangeKind kind, int line, const GridPoint& place, double moved = 0) {
    result_.changes.push_back({kind, line, result_.plan.Metres(place), moved * options_.grid_m});
  }

  // Walls in grid coordinates around the middle of the plan; those of no length are left out.
  Status TakeWalls() {
    std::vector<InputSegment> segments = input_.segments;
    for (size_t ring = 0; ring < input_.rings.size(); ++ring) {
      const std::vector<Vec2>& points = input_.rings[ring];
      for (size_t i = 0; i < points.size(); ++i)
        segments.push_back({points[i], points[(i + 1) % points.size()], static_cast<int>(ring) + 1});
    }
    Vec2 low = segments[0].start, high = low;
    for (const InputSegment& segment : segments) {
      low = low.cwiseMin(segment.start).cwiseMin(segment.end);
      high = high.cwiseMax(segment.start).cwiseMax(segment.end);
    }
    FloorPlan& plan = result_.plan;
    plan.grid_m = options_.grid_m;
    plan.origin = (0.5 * (low + high)).array().round();
    const double reach = 0.5 * (high - low).maxCoeff() + options_.margin_m + 2;
    if (reach / options_.grid_m > static_cast<double>(kMaxGridCoordinate)) {
      return MakeError(ErrorCode::kUnsupported,
                       "the plan is {:.0f} m across, but at most {:.0f} m are possible with a grid of {:g} "
                       "m; give a coarser --grid-m",
                       (high - low).maxCoeff(), 1.9 * kMaxGridCoordinate * options_.grid_m, options_.grid_m);
    }
    for (const InputSegment& segment : segments) {
      const Wall wall{Round(segment.start), Round(segment.end), segment.line, {}};
      if (wall.start == wall.end) {
        Note(PlanChangeKind::kNoLength, wall.line, wall.start);
      } else {
        walls_.push_back(wall);
      }
    }
    return Ok();
  }

  GridPoint Round(const Vec2& metres) const {
    const Vec2 grid = result_.plan.Grid(metres);
    return {std::llround(grid.x()), std::llround(grid.y())};
  }

  // Every end goes to the nearest earlier end within the tolerance that did not move itself.
  Status SnapEndsTogether() {
    const double snap = options_.snap_m / options_.grid_m;
    const double cell = std::max(1.0, snap);
    std::map<std::pair<int64_t, int64_t>, std::vector<GridPoint>> leaders;
    const auto cell_of = [&](double value) { return static_cast<int64_t>(std::floor(value / cell)); };
    for (Wall& wall : walls_) {
      for (GridPoint* end : {&wall.start, &wall.end}) {
        const auto x = static_cast<double>(end->x), y = static_cast<double>(end->y);
        const GridPoint* nearest = nullptr;
        double nearest_distance = snap;
        for (int64_t i = cell_of(x) - 1; i <= cell_of(x) + 1; ++i) {
          for (int64_t j = cell_of(y) - 1; j <= cell_of(y) + 1; ++j) {
            const auto found = leaders.find({i, j});
            if (found == leaders.end()) continue;
            for (const GridPoint& leader : found->second) {
              const double distance = (Real(leader) - Real(*end)).norm();
              if (distance > nearest_distance || (nearest != nullptr && distance == nearest_distance))
                continue;
              nearest = &leader;
              nearest_distance = distance;
            }
          }
        }
        if (nearest == nullptr) {
          leaders[{cell_of(x), cell_of(y)}].push_back(*end);
        } else if (!(*nearest == *end)) {
          Note(PlanChangeKind::kEndMoved, wall.line, *end, nearest_distance);
          *end = *nearest;
        }
      }
    }
    DropWithoutLength();
    return progress_.Cancelled() ? Status(MakeError(ErrorCode::kCancelled, "cancelled")) : Ok();
  }

  void DropWithoutLength() {
    std::erase_if(walls_, [&](const Wall& wall) {
      if (wall.start == wall.end) Note(PlanChangeKind::kNoLength, wall.line, wall.start);
      return wall.start == wall.end;
    });
  }

  // Ends near the inside of another wall are moved onto it, with all walls that end there.
  Status SnapEndsOntoWalls() {
    const double snap = options_.snap_m / options_.grid_m;
    std::map<GridPoint, std::vector<std::pair<size_t, bool>>> ends;
    for (size_t i = 0; i < walls_.size(); ++i) {
      ends[walls_[i].start].push_back({i, false});
      ends[walls_[i].end].push_back({i, true});
    }
    // An end moves once, by no more than snap and a rounding.
    const WallsNear walls_near(walls_, 2 * snap + 2);
    progress_.Begin("clean", static_cast<int64_t>(ends.size()), "ends of walls");
    for (const auto& [place, users] : ends) {
      if (progress_.Cancelled()) return MakeError(ErrorCode::kCancelled, "cancelled");
      progress_.Advance();
      Wall* nearest = nullptr;
      GridPoint nearest_place;
      double nearest_distance = snap;
      for (const int32_t index : walls_near.At(place)) {
        Wall& wall = walls_[index];
        const std::optional<GridPoint> onto = NearestInside(wall, place, snap);
        if (!onto) continue;
        const double distance = (Real(*onto) - Real(place)).norm();
        if (distance > nearest_distance) continue;
        nearest = &wall;
        nearest_place = *onto;
        nearest_distance = distance;
      }
      if (nearest == nullptr) continue;
      nearest->through.push_back(nearest_place);
      if (nearest_place == place) continue;
      Note(PlanChangeKind::kEndOnWall, walls_[users[0].first].line, place, nearest_distance);
      for (const auto& [wall, is_end] : users)
        (is_end ? walls_[wall].end : walls_[wall].start) = nearest_place;
    }
    progress_.End();
    DropWithoutLength();
    return Ok();
  }

  // The grid point nearest to the foot of `place` on the wall, if that is inside of the wall and near.
  static std::optional<GridPoint> NearestInside(const Wall& wall, const GridPoint& place, double snap) {
    const Vec2 start = Real(wall.start), end = Real(wall.end), along = end - start, point = Real(place);
    const Vec2 low = start.cwiseMin(end).array() - snap, high = start.cwiseMax(end).array() + snap;
    if ((point.array() < low.array()).any() || (point.array() > high.array()).any()) return std::nullopt;
    if (place == wall.start || place == wall.end) return std::nullopt;
    const double share = (point - start).dot(along) / along.squaredNorm();
    if (share <= 0 || share >= 1) return std::nullopt;
    const Vec2 foot = start + share * along;
    // Closer than the grid's resolution: it already lies on the wall.
    if ((foot - point).cwiseAbs().maxCoeff() <= 0.5) return place;
    return GridPoint{std::llround(foot.x()), std::llround(foot.y())};
  }

  // The wall from end to end through what was moved onto it.
  void AddSegments(int32_t index, std::vector<TaggedSegment>* segments) const {
    const Wall& wall = walls_[index];
    const Vec2 start = Real(wall.start), along = Real(wall.end) - start;
    std::vector<std::pair<double, Vec2>> stops;
    for (const GridPoint& point : wall.through) {
      const double share = (Real(point) - start).dot(along) / along.squaredNorm();
      if (share > 0 && share < 1) stops.push_back({share, Real(point)});
    }
    std::sort(stops.begin(), stops.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    stops.push_back({1, Real(wall.end)});
    Vec2 from = start;
    for (const auto& [share, to] : stops) {
      if (to != from) segments->push_back({from, to, index});
      from = to;
    }
  }

  void DropDuplicates() {
    std::set<std::pair<GridPoint, GridPoint>> seen;
    std::erase_if(walls_, [&](const Wall& wall) {
      const bool fresh = seen.insert(std::minmax(wall.start, wall.end)).second;
      if (!fresh && !input_.closed()) Note(PlanChangeKind::kDuplicate, wall.line, wall.start);
      return !fresh && !input_.closed();
    });
  }

  Result<NodedSegments> Noded(const std::vector<TaggedSegment>& segments) {
    CancelOnly progress(progress_);  // a plan has few walls
    return SegmentNoder(segments).Node(kNumThreads, progress);
  }

  // Pieces between the places where walls meet; walls that continue each other become one.
  Status Divide() {
    std::vector<TaggedSegment> segments;
    for (size_t i = 0; i < walls_.size(); ++i) AddSegments(static_cast<int32_t>(i), &segments);
    CAIRN_ASSIGN_OR_RETURN(NodedSegments noded, Noded(segments));
    NoteCrossings(noded);
    std::vector<PlanPiece> pieces = WithoutOverlaps(noded, /*note=*/true);
    const double tolerance = options_.simplify_m / options_.grid_m;
    std::vector<int32_t> origins(walls_.size());  // of the pieces' walls, among walls_
    std::iota(origins.begin(), origins.end(), 0);
    // Where joining moved a wall it may touch others: divide again until nothing changes.
    for (size_t before = pieces.size() + 1; pieces.size() != before;) {
      before = pieces.size();
      JoinedWalls joined = JoinWalls(noded.vertices, pieces, tolerance, input_.closed());
      for (int32_t& origin : joined.origins) origin = origins[origin];
      origins = std::move(joined.origins);
      for (const auto& [vertex, wall] : joined.removed_vertices)
        Note(PlanChangeKind::kPointRemoved, walls_[origins[wall]].line, noded.vertices[vertex]);
      segments.clear();
      for (const PlanPiece& piece : joined.pieces)
        segments.push_back({Real(noded.vertices[piece.start]), Real(noded.vertices[piece.end]), piece.wall});
      CAIRN_ASSIGN_OR_RETURN(noded, Noded(segments));
      pieces = WithoutOverlaps(noded, /*note=*/false);
    }
    MakePlan(noded.vertices, std::move(pieces));
    return Ok();
  }

  // Notes vertices at which no wall ended.
  void NoteCrossings(const NodedSegments& noded) {
    std::set<GridPoint> ends;
    for (const Wall& wall : walls_) {
      ends.insert({wall.start, wall.end});
      ends.insert(wall.through.begin(), wall.through.end());
    }
    for (const GridPoint& vertex : noded.vertices) {
      if (!ends.contains(vertex)) Note(PlanChangeKind::kCrossing, 0, vertex);
    }
  }

  // Keeps, of pieces between the same vertices, the one of the first wall.
  std::vector<PlanPiece> WithoutOverlaps(const NodedSegments& noded, bool note) {
    std::map<std::pair<int32_t, int32_t>, PlanPiece> first;
    for (const NodedEdge& edge : noded.edges) {
      const PlanPiece piece{edge.start, edge.end, edge.tag};
      const auto [found, fresh] = first.emplace(std::minmax(edge.start, edge.end), piece);
      if (fresh) continue;
      const int32_t dropped = std::max(found->second.wall, piece.wall);
      if (note) Note(PlanChangeKind::kOverlap, walls_[dropped].line, noded.vertices[edge.start]);
      if (piece.wall < found->second.wall) found->second = piece;
    }
    std::vector<PlanPiece> pieces;
    for (const auto& [ends, piece] : first) pieces.push_back(piece);
    return pieces;
  }

  // Numbers walls in the order of their pieces' walls, and measures them.
  void MakePlan(const std::vector<GridPoint>& vertices, std::vector<PlanPiece> pieces) {
    FloorPlan& plan = result_.plan;
    plan.vertices = vertices;
    std::map<int32_t, std::vector<PlanPiece>> by_wall;
    for (const PlanPiece& piece : pieces) by_wall[piece.wall].push_back(piece);
    for (auto& [old_wall, parts] : by_wall) {
      Vec2 along = Vec2::Zero();
      for (const PlanPiece& part : parts) along += Real(vertices[part.end]) - Real(vertices[part.start]);
      const auto order = [&](int32_t vertex) { return Real(vertices[vertex]).dot(along); };
      std::sort(parts.begin(), parts.end(),
                [&](const PlanPiece& a, const PlanPiece& b) { return order(a.start) < order(b.start); });
      for (PlanPiece& part : parts) {
        part.wall = plan.num_walls();
        plan.pieces.push_back(part);
      }
      plan.walls.push_back(
          {plan.Metres(vertices[parts.front().start]), plan.Metres(vertices[parts.back().end])});
    }
  }

  // Rings made from the cleaned pieces would be ambiguous where they touch, so the rounded rings are checked.
  Status CheckCleanedRings() const {
    std::vector<std::vector<Vec2>> rings;
    for (const std::vector<Vec2>& ring : input_.rings) {
      std::vector<Vec2>& rounded = rings.emplace_back();
      for (const Vec2& point : ring) {
        const Vec2 place = result_.plan.Metres(Round(point));
        if (rounded.empty() || rounded.back() != place) rounded.push_back(place);
      }
      if (rounded.size() > 1 && rounded.front() == rounded.back()) rounded.pop_back();
      if (rounded.size() < 3) {
        return MakeError(ErrorCode::kCorrupt, "ring {} has no area", rings.size());
      }
    }
    return CheckRings(rings);
  }

  void SetDomain() {
    FloorPlan& plan = result_.plan;
    plan.low = plan.high = plan.vertices[0];
    for (const GridPoint& vertex : plan.vertices) {
      plan.low = {std::min(plan.low.x, vertex.x), std::min(plan.low.y, vertex.y)};
      plan.high = {std::max(plan.high.x, vertex.x), std::max(plan.high.y, vertex.y)};
    }
    if (plan.closed) return;
    const auto margin = std::llround(options_.margin_m / options_.grid_m);
    plan.low = {plan.low.x - margin, plan.low.y - margin};
    plan.high = {plan.high.x + margin, plan.high.y + margin};
  }

  const InputPlan& input_;
  const CleanPlanOptions& options_;
  Progress& progress_;
  std::vector<Wall> walls_;
  CleanPlanResult result_;
};

}  // namespace

const char* PlanChangeName(PlanChangeKind kind) {
  switch (kind) {
    case PlanChangeKind::kNoLength:
      return "walls without length left out";
    case PlanChangeKind::kEndMoved:
      return "ends moved to another end";
    case PlanChangeKind::kEndOnWall:
      return "ends moved onto another wall";
    case PlanChangeKind::kDuplicate:
      return "duplicate walls left out";
    case PlanChangeKind::kOverlap:
      return "overlaps kept once";
    case PlanChangeKind::kCrossing:
      return "vertices added where walls cross";
    case PlanChangeKind::kPointRemoved:
      return "points removed between walls that continue each other";
  }
  return "?";
}

Result<CleanPlanResult> CleanPlan(const InputPlan& input, const CleanPlanOptions& options,
                                  Progress& progress) {
  size_t num_walls = input.segments.size();
  for (const std::vector<Vec2>& ring : input.rings) num_walls += ring.size();
  if (num_walls > kMaxNumDividedWalls) {
    return MakeError(ErrorCode::kUnsupported,
                     "{} walls; at most {} are divided, as what is seen is looked for between all pairs of "
                     "their ends.  Points of a laser, and furniture, are no walls: fit lines to them, or "
                     "divide the plan by buildings and floors",
                     num_walls, kMaxNumDividedWalls);
  }
  if (input.closed()) CAIRN_RETURN_IF_ERROR(CheckRings(input.rings));
  if (!input.closed() && input.segments.empty()) return MakeError(ErrorCode::kNoData, "a plan without walls");
  return Cleaner(input, options, progress).Run();
}

}  // namespace cairn::decompose_views
