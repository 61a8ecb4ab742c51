#include "runtime/paths/search_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <queue>

#include "core/geometry/vector_geometry.h"
#include "runtime/paths/fewest_looks.h"
#include "runtime/paths/plan_roadmap.h"
#include "runtime/paths/reached_part.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
// Pieces of the floor smaller than this, that can be seen, are worth no look, m2.
constexpr double kSliverM2 = 1e-4;

// A region that stands for those around it.
struct Spot {
  FaceIdx face = 0;
  Vec2 middle = Vec2::Zero();
  double area = 0;  // of all regions that it stands for
};

// All regions if there are at most `most`; otherwise the largest region of each cell of a grid with about as
// many cells, standing for all regions with their middles in the cell.
std::vector<Spot> SpreadSpots(const Views& views, int most) {
  const Vec2 low = views.plan.Metres(views.plan.low);
  double domain = 0;
  for (FaceIdx face = 0; face < views.num_faces(); ++face) domain += views.Area(face);
  const double cell_m = std::max(1e-3, std::sqrt(domain / most));
  struct Cell {
    double area = 0, largest = 0;
    FaceIdx face = 0;
  };
  std::map<std::array<int64_t, 3>, Cell> cells;
  for (FaceIdx face = 0; face < views.num_faces(); ++face) {
    const Vec2 at = (views.Centroid(face) - low) / cell_m;
    const std::array<int64_t, 3> key = {static_cast<int64_t>(std::floor(at.x())),
                                        static_cast<int64_t>(std::floor(at.y())),
                                        views.num_faces() <= most ? face : 0};
    Cell& cell = cells[key];
    const double area = views.Area(face);
    cell.area += area;
    if (area <= cell.largest) continue;
    cell.largest = area;
    cell.face = face;
  }
  std::vector<Spot> spots;
  for (const auto& [key, cell] : cells) spots.push_back({cell.face, views.Centroid(cell.face), cell.area});
  return spots;
}

// All links of a roadmap, and the shortest ways over them from node 0, the start, and others.
class RoadmapWays {
 public:
  explicit RoadmapWays(const PlanRoadmap& roadmap) : roadmap_(roadmap), links_(roadmap.num_nodes()) {
    for (int i = 0; i < roadmap.num_nodes(); ++i) {
      for (int k = 0; k < i; ++k) {
        if (!roadmap.AreJoined(i, k)) continue;
        links_[i].push_back(k);
        links_[k].push_back(i);
      }
    }
    Lengths(0, &from_start_, nullptr);
  }

  bool IsReached(int node) const { return std::isfinite(from_start_[node]); }

  // Dijkstra: lengths of the shortest ways from a node to all, and the node before each.
  void Lengths(int from, std::vector<double>* lengths, std::vector<int>* before) const {
    lengths->assign(links_.size(), std::numeric_limits<double>::infinity());
    if (before != nullptr) before->assign(links_.size(), -1);
    (*lengths)[from] = 0;
    using Entry = std::pair<double, int>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    queue.push({0, from});
    while (!queue.empty()) {
      const auto [length, at] = queue.top();
      queue.pop();
      if (length > (*lengths)[at]) continue;
      for (const int next : links_[at]) {
        const double sum = length + (roadmap_.place(next) - roadmap_.place(at)).norm();
        if (sum >= (*lengths)[next]) continue;
        (*lengths)[next] = sum;
        if (before != nullptr) (*before)[next] = at;
        queue.push({sum, next});
      }
    }
  }

  std::vector<int> Way(int from, int to) const {
    std::vector<double> lengths;
    std::vector<int> before, nodes;
    Lengths(from, &lengths, &before);
    for (int at = to; at >= 0; at = before[at]) nodes.push_back(at);
    std::reverse(nodes.begin(), nodes.end());
    return Tightened(nodes, [&](int a, int b) { return roadmap_.AreJoined(a, b); });
  }

 private:
  const PlanRoadmap& roadmap_;
  std::vector<std::vector<int>> links_;
  std::vector<double> from_start_;
};

// An open tour from the first place: the nearest next, then exchanges of two legs while they shorten it.
std::vector<int> ShortTour(const RoadmapWays& ways, const std::vector<int>& places) {
  const size_t num = places.size();
  std::vector<std::vector<double>> legs(num);
  for (size_t i = 0; i < num; ++i) {
    std::vector<double> lengths;
    ways.Lengths(places[i], &lengths, nullptr);
    for (const int place : places) legs[i].push_back(lengths[place]);
  }
  std::vector<size_t> tour(num);
  std::iota(tour.begin(), tour.end(), 0);
  for (size_t i = 1; i < num; ++i) {
    const auto nearest =
        std::min_element(tour.begin() + static_cast<std::ptrdiff_t>(i), tour.end(),
                         [&](size_t a, size_t b) { return legs[tour[i - 1]][a] < legs[tour[i - 1]][b]; });
    std::swap(tour[i], *nearest);
  }
  for (bool better = true; better;) {
    better = false;
    for (size_t i = 1; i + 1 < num; ++i) {
      for (size_t k = i + 1; k < num; ++k) {
        const bool last = k + 1 == num;
        const double old_way = legs[tour[i - 1]][tour[i]] + (last ? 0 : legs[tour[k]][tour[k + 1]]);
        const double new_way = legs[tour[i - 1]][tour[k]] + (last ? 0 : legs[tour[i]][tour[k + 1]]);
        if (new_way >= old_way - 1e-9) continue;
        std::reverse(tour.begin() + static_cast<std::ptrdiff_t>(i),
                     tour.begin() + static_cast<std::ptrdiff_t>(k + 1));
        better = true;
      }
    }
  }
  std::vector<int> order;
  for (const size_t i : tour) order.push_back(places[i]);
  return order;
}

// Whether the middle of a region and its corners are seen.
bool SeesRegion(const LookAround& look, const Views& views, const Spot& spot) {
  if (!look.Sees(spot.middle)) return false;
  for (int64_t i = views.face_offsets[spot.face]; i < views.face_offsets[spot.face + 1]; ++i) {
    // A little inside, where no wall begins.
    const Vec2 corner = views.plan.Metres(views.vertices[views.face_vertices[i]]);
    if (!look.Sees(corner + 1e-3 * (spot.middle - corner))) return false;
  }
  return true;
}

// The parts of a line, place + t * direction for t in [from, to], where a robot keeps a radius from all
// walls.
std::vector<std::pair<double, double>> FreeStretches(const FloorPlan& plan, const Vec2& place,
                                                     const Vec2& direction, double from, double to,
                                                     double radius_m) {
  std::vector<std::pair<double, double>> near;
  for (const PlanPiece& piece : plan.pieces) {
    const Vec2 start = plan.Metres(plan.vertices[piece.start]) - place;
    const Vec2 end = plan.Metres(plan.vertices[piece.end]) - place;
    // What is near to a piece is convex: two circles, and a rectangle between them.
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Vec2& tip : {start, end}) {
      const double across = Cross(direction, tip), squared = radius_m * radius_m - across * across;
      if (squared <= 0) continue;
      low = std::min(low, direction.dot(tip) - std::sqrt(squared));
      high = std::max(high, direction.dot(tip) + std::sqrt(squared));
    }
    const Vec2 along = (end - start).normalized(), left(-along.y(), along.x());
    const auto meet = [&](const Vec2& a, const Vec2& b) {
      const double side_a = Cross(direction, a), side_b = Cross(direction, b);
      if (side_a * side_b > 0 || side_a == side_b) return;
      const Vec2 meeting = a + side_a / (side_a - side_b) * (b - a);
      low = std::min(low, direction.dot(meeting));
      high = std::max(high, direction.dot(meeting));
    };
    meet(start + radius_m * left, end + radius_m * left);
    meet(start - radius_m * left, end - radius_m * left);
    if (low < high && high > from && low < to) near.emplace_back(low, high);
  }
  std::sort(near.begin(), near.end());
  std::vector<std::pair<double, double>> free;
  double at = from;
  for (const auto& [low, high] : near) {
    if (low > at) free.emplace_back(at, low);
    at = std::max(at, high);
  }
  if (at < to) free.emplace_back(at, to);
  return free;
}

// Chooses where to look from.
class SearchPlanner {
 public:
  SearchPlanner(const PlanSpace& space, const Vec2& from, const PlanPathOptions& options)
      : space_(space),
        options_(options),
        reached_(space, options.radius_m, from),
        floor_(ConnectedFloor(space)),
        from_part_(floor_[space.FaceAt(from)]) {
    looks_.emplace_back(space, from);
    spots_ = SpreadSpots(space.views(), options.max_num_places);
    for (const Spot& spot : spots_) {
      if (reached_.Contains(spot.middle)) looks_.emplace_back(space, spot.middle);
    }
  }

  // The start first.
  std::vector<Vec2> Run(SearchPath* result) {
    ChooseByRegions();
    const std::vector<ConvexPiece> floor = FloorPieces(space_);
    std::vector<ConvexPiece> unseen;
    SeeTheRest(floor, &unseen);
    if (options_.seen_ratio >= 1) DropNeedless(floor);
    result->domain_area_m2 = AreaOf(floor);
    result->visible_area_m2 = result->domain_area_m2 - AreaOf(unseen);
    result->seen_area_m2 = result->domain_area_m2 - AreaOf(HiddenFrom(chosen_, floor));
    result->unseen = Joined(unseen);
    result->unreached_area_m2 = std::max(0.0, result->domain_area_m2 - reached_.Area());
    result->fewest_places = options_.seen_ratio < 1 ? 1 : LeastNumPlaces();
    std::vector<Vec2> places;
    for (const size_t i : chosen_) places.push_back(looks_[i].place());
    return places;
  }

 private:
  NumberSet RegionsSeen(const LookAround& look) const {
    NumberSet seen(spots_.size());
    for (size_t k = 0; k < spots_.size(); ++k) {
      if (SeesRegion(look, space_.views(), spots_[k])) seen.Insert(k);
    }
    return seen;
  }

  void ChooseByRegions() {
    for (const LookAround& look : looks_) sees_.push_back(RegionsSeen(look));
    std::vector<double> areas;
    for (const Spot& spot : spots_) areas.push_back(spot.area);
    chosen_ = FewSets(sees_, areas, options_.seen_ratio);
  }

  std::vector<ConvexPiece> HiddenFrom(const std::vector<size_t>& places,
                                      std::vector<ConvexPiece> pieces) const {
    for (const size_t i : places) pieces = looks_[i].Hidden(pieces);
    return pieces;
  }

  // Places that were added may make others needless.
  void DropNeedless(const std::vector<ConvexPiece>& floor) {
    const double hidden_area = AreaOf(HiddenFrom(chosen_, floor));
    for (size_t i = chosen_.size(); i-- > 1;) {
      std::vector<size_t> others = chosen_;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      NumberSet seen(spots_.size());
      for (const size_t other : others) seen.InsertAll(sees_[other]);
      if (!sees_[chosen_[i]].IsWithin(seen)) continue;
      if (AreaOf(HiddenFrom(others, floor)) < hidden_area + kSliverM2) chosen_ = others;
    }
  }

  // A place that the robot gets to from which a point is seen.
  std::optional<Vec2> PlaceThatSees(const Vec2& point) const {
    // Nobody sees into another part of the floor.
    const FaceIdx face = space_.FaceAt(point);
    if (face < 0 || floor_[face] != from_part_) return std::nullopt;
    const LookAround* nearest = nullptr;
    for (const LookAround& look : looks_) {
      const double distance = (look.place() - point).squaredNorm();
      if (nearest != nullptr && distance >= (nearest->place() - point).squaredNorm()) continue;
      if (look.Sees(point)) nearest = &look;
    }
    if (nearest != nullptr) return nearest->place();
    if (reached_.Contains(point)) return point;
    if (options_.radius_m <= 0) return std::nullopt;
    // Where the robot gets to is connected and has places that do not see the point.  If others do, some are
    // on the border of what the point sees, and not on walls: on a line behind a wall's end.
    const LookAround look(space_, point);
    for (size_t i = 0; i < look.arcs().size(); ++i) {
      const BlockedArc &arc = look.arcs()[i], &next = look.arcs()[(i + 1) % look.arcs().size()];
      const double distance = arc.Distance(arc.to), next_distance = next.Distance(next.from);
      const Vec2 direction(std::cos(arc.to), std::sin(arc.to));
      for (const auto& [low, high] :
           FreeStretches(space_.views().plan, point, direction, std::min(distance, next_distance),
                         std::max(distance, next_distance), options_.radius_m)) {
        const Vec2 place = point + 0.5 * (low + high) * direction;
        if (reached_.Contains(place)) return place;
      }
    }
    return std::nullopt;
  }

  // Sorts pieces by whether they can be seen: those of which the middle and the corners can, and the others
  // in halves, down to 2 cm, where the middle decides.
  void Sort(const ConvexPiece& piece, double size_m, std::vector<ConvexPiece>* open,
            std::vector<ConvexPiece>* unseen) const {
    constexpr double kLeastSizeM = 0.02;
    for (const ConvexPiece& part : Divided({piece}, size_m)) {
      const Vec2 middle = CentroidOf(part);
      const bool sees_middle = PlaceThatSees(middle).has_value();
      const bool is_mixed = std::any_of(part.begin(), part.end(), [&](const Vec2& corner) {
        // A little inside, where no wall begins.
        return PlaceThatSees(corner + 1e-3 * (middle - corner)).has_value() != sees_middle;
      });
      if (is_mixed && size_m > kLeastSizeM) {
        Sort(part, 0.5 * size_m, open, unseen);
      } else {
        (sees_middle ? open : unseen)->push_back(part);
      }
    }
  }

  // Adds places until enough of the floor is seen; then `unseen` is what cannot be.
  void SeeTheRest(const std::vector<ConvexPiece>& floor, std::vector<ConvexPiece>* unseen) {
    constexpr double kPieceM = 0.1, kMaxNumPieces = 2000;
    const double domain_area = AreaOf(floor);
    const std::vector<ConvexPiece> hidden = HiddenFrom(chosen_, floor);
    const double size_m = std::max(kPieceM, std::sqrt(AreaOf(hidden) / kMaxNumPieces));
    std::vector<ConvexPiece> open;
    for (const ConvexPiece& piece : hidden) {
      std::vector<ConvexPiece> open_parts, unseen_parts;
      Sort(piece, size_m, &open_parts, &unseen_parts);
      if (open_parts.empty()) unseen_parts = {piece};
      open.insert(open.end(), open_parts.begin(), open_parts.end());
      unseen->insert(unseen->end(), unseen_parts.begin(), unseen_parts.end());
    }
    while (AreaOf(open) > (1 - options_.seen_ratio) * (domain_area - AreaOf(*unseen))) {
      std::optional<LookAround> best;
      std::vector<ConvexPiece> rest;
      double most = kSliverM2;
      for (const Vec2& place : Proposals(open, unseen)) {
        LookAround look(space_, place);
        std::vector<ConvexPiece> left = look.Hidden(open);
        const double gain = AreaOf(open) - AreaOf(left);
        if (gain <= most) continue;
        most = gain;
        best = std::move(look);
        rest = std::move(left);
      }
      if (!best) break;
      chosen_.push_back(looks_.size());
      sees_.push_back(RegionsSeen(*best));
      looks_.push_back(std::move(*best));
      open = std::move(rest);
    }
  }

  // Places that see the largest of these pieces; pieces that are seen from nowhere are moved.
  std::vector<Vec2> Proposals(std::vector<ConvexPiece>& open, std::vector<ConvexPiece>* unseen) const {
    constexpr size_t kMaxNumProposals = 24;
    std::stable_sort(open.begin(), open.end(),
                     [](const ConvexPiece& a, const ConvexPiece& b) { return AreaOf(a) > AreaOf(b); });
    std::vector<Vec2> places;
    std::vector<ConvexPiece> rest;
    for (ConvexPiece& piece : open) {
      if (places.size() < kMaxNumProposals && AreaOf(piece) > kSliverM2) {
        const std::optional<Vec2> place = PlaceThatSees(CentroidOf(piece));
        if (!place) {
          unseen->push_back(std::move(piece));
          continue;
        }
        if (std::find(places.begin(), places.end(), *place) == places.end()) places.push_back(*place);
      }
      rest.push_back(std::move(piece));
    }
    open = std::move(rest);
    return places;
  }

  // Middles of regions, and points in the inner corners of walls, which fewer places see.
  std::vector<Vec2> WitnessPlaces() const {
    std::vector<Vec2> places;
    for (const Spot& spot : spots_) places.push_back(spot.middle);
    constexpr double kFromCornerM = 0.02;
    const FloorPlan& plan = space_.views().plan;
    for (const WallCorner& gap : space_.gaps()) {
      if (gap.first == gap.last || Orientation(gap.vertex, gap.first, gap.last) <= 0) continue;
      const Vec2 vertex = Real(gap.vertex);
      const Vec2 middle = (Real(gap.first) - vertex).normalized() + (Real(gap.last) - vertex).normalized();
      const Vec2 place = plan.Metres(gap.vertex) + kFromCornerM * middle.normalized();
      if (space_.FaceAt(place) >= 0) places.push_back(place);
    }
    return places;
  }

  int LeastNumPlaces() const {
    std::vector<Witness> witnesses, not_from_start;
    for (const Vec2& place : WitnessPlaces()) {
      // What is not seen needs no look.
      if (std::none_of(chosen_.begin(), chosen_.end(), [&](size_t i) { return looks_[i].Sees(place); }))
        continue;
      Witness witness{LookAround(space_, place), NumberSet(looks_.size())};
      for (size_t i = 0; i < looks_.size(); ++i) {
        if (looks_[i].Sees(place)) witness.viewers.Insert(i);
      }
      if (!witness.viewers.Contains(0)) not_from_start.push_back(witness);
      witnesses.push_back(std::move(witness));
    }
    return std::max(LeastNumLooks(witnesses, options_.radius_m),
                    1 + LeastNumLooks(not_from_start, options_.radius_m));
  }

  // Pieces that have a common border, not along a wall, are one part.
  std::vector<FloorPart> Joined(const std::vector<ConvexPiece>& pieces) const {
    std::vector<size_t> part_of(pieces.size());
    std::iota(part_of.begin(), part_of.end(), 0);
    for (size_t i = 0; i < pieces.size(); ++i) {
      for (size_t k = 0; k < i; ++k) {
        if (part_of[i] == part_of[k] || !AreNeighbours(pieces[i], pieces[k])) continue;
        const size_t from = std::max(part_of[i], part_of[k]), to = std::min(part_of[i], part_of[k]);
        std::replace(part_of.begin(), part_of.begin() + static_cast<std::ptrdiff_t>(i) + 1, from, to);
      }
    }
    std::map<size_t, FloorPart> parts;
    for (size_t i = 0; i < pieces.size(); ++i) {
      FloorPart& part = parts[part_of[i]];
      part.area_m2 += AreaOf(pieces[i]);
      part.pieces.push_back(pieces[i]);
    }
    std::vector<FloorPart> list;
    for (auto& [number, part] : parts) {
      part.at = CentroidOf(*std::max_element(
          part.pieces.begin(), part.pieces.end(),
          [](const ConvexPiece& a, const ConvexPiece& b) { return AreaOf(a) < AreaOf(b); }));
      list.push_back(std::move(part));
    }
    std::stable_sort(list.begin(), list.end(),
                     [](const FloorPart& a, const FloorPart& b) { return a.area_m2 > b.area_m2; });
    return list;
  }

  bool AreNeighbours(const ConvexPiece& a, const ConvexPiece& b) const {
    constexpr double kApartM = 1e-5;
    for (size_t i = 0; i < a.size(); ++i) {
      const Vec2 start = a[i], along = a[(i + 1) % a.size()] - start;
      const double length = along.norm();
      if (length < kApartM) continue;
      const Vec2 unit = along / length, left(-unit.y(), unit.x());
      for (size_t k = 0; k < b.size(); ++k) {
        const Vec2 p = b[k] - start, q = b[(k + 1) % b.size()] - start;
        if (std::max(std::abs(left.dot(p)), std::abs(left.dot(q))) > kApartM) continue;
        const double low = std::max(0.0, std::min(unit.dot(p), unit.dot(q)));
        const double high = std::min(length, std::max(unit.dot(p), unit.dot(q)));
        if (high - low < kApartM) continue;
        const Vec2 middle = start + 0.5 * (low + high) * unit;
        if (space_.PassageBetween(middle - 5 * kApartM * left, middle + 5 * kApartM * left).IsOpen())
          return true;
      }
    }
    return false;
  }

  const PlanSpace& space_;
  const PlanPathOptions& options_;
  const ReachedPart reached_;
  const std::vector<int> floor_;
  const int from_part_;
  std::vector<Spot> spots_;
  std::vector<LookAround> looks_;  // to choose from: from the start, then from middles of regions
  std::vector<NumberSet> sees_;    // the regions that each of them sees
  std::vector<size_t> chosen_;
};

}  // namespace

Result<SearchPath> FindSearchPath(const PlanSpace& space, const Vec2& from, const PlanPathOptions& options) {
  PlanPathOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_RETURN_IF_ERROR(CheckStands(space, from, options.radius_m));
  SearchPath result;
  const std::vector<Vec2> places = SearchPlanner(space, from, options).Run(&result);
  const PlanRoadmap roadmap(space, options.radius_m, places);
  const RoadmapWays ways(roadmap);
  std::vector<int> looks(places.size());
  std::iota(looks.begin(), looks.end(), 0);
  const std::vector<int> tour = ShortTour(ways, looks);
  std::vector<Vec2> points{from};
  for (size_t i = 0; i < tour.size(); ++i) {
    result.places.push_back(roadmap.place(tour[i]));
    if (i == 0) continue;
    const std::vector<Vec2> leg = roadmap.Places(ways.Way(tour[i - 1], tour[i]));
    points.insert(points.end(), leg.begin() + 1, leg.end());
  }
  result.path = MeasuredPath(std::move(points));
  return result;
}

}  // namespace cairn
