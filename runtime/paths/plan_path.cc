#include "runtime/paths/plan_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <queue>

#include "runtime/paths/plan_roadmap.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

Error NoWay(const Vec2& from, const Vec2& to, double radius_m) {
  return MakeError(ErrorCode::kNoData,
                   "no way from ({:g}, {:g}) to ({:g}, {:g}) for a robot of radius {:g} m", from.x(),
                   from.y(), to.x(), to.y(), radius_m);
}

// Errors: InvalidArgument outside of the domain, NoData where the robot does not fit.
Status CheckStands(const PlanSpace& space, const Vec2& place, double radius_m) {
  CAIRN_RETURN_IF_ERROR(space.CheckInside(place));
  if (space.IsFree(place, place, radius_m)) return Ok();
  if (radius_m <= 0) {
    return MakeError(ErrorCode::kNoData, "the place ({:g}, {:g}) lies on a wall, on neither side of it",
                     place.x(), place.y());
  }
  return MakeError(ErrorCode::kNoData,
                   "a robot of radius {:g} m does not fit at ({:g}, {:g}): a wall is {:.3f} m away", radius_m,
                   place.x(), place.y(), space.Clearance(place));
}

PlanPath Measured(std::vector<Vec2> points) {
  PlanPath path{std::move(points), 0};
  for (size_t i = 0; i + 1 < path.points.size(); ++i)
    path.length_m += (path.points[i + 1] - path.points[i]).norm();
  return path;
}

std::vector<Vec2> PlacesOf(const PlanRoadmap& roadmap, const std::vector<int>& nodes) {
  std::vector<Vec2> places;
  for (const int node : nodes) places.push_back(roadmap.place(node));
  return places;
}

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

// Whether the middle of a region and its corners are seen from a place.
bool SeesRegion(const PlanSpace& space, const Vec2& place, const Spot& spot) {
  if (!space.PassageBetween(place, spot.middle).IsOpen()) return false;
  const Views& views = space.views();
  for (int64_t i = views.face_offsets[spot.face]; i < views.face_offsets[spot.face + 1]; ++i) {
    // A little inside, where no wall begins.
    const Vec2 corner = views.plan.Metres(views.vertices[views.face_vertices[i]]);
    if (!space.PassageBetween(place, corner + 1e-3 * (spot.middle - corner)).IsOpen()) return false;
  }
  return true;
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

// Reached places (the start, node 0, and the middles of regions, the nodes after it) that add the most area
// to what is seen, the start first, until enough is seen.
std::vector<int> ChooseLookingPlaces(const PlanSpace& space, const PlanRoadmap& roadmap,
                                     const RoadmapWays& ways, const std::vector<Spot>& spots,
                                     double seen_ratio, SearchPath* result) {
  const size_t num = spots.size() + 1;
  std::vector<std::vector<size_t>> sees(num);
  std::vector<bool> to_see(spots.size(), false);
  for (size_t i = 0; i < num; ++i) {
    if (!ways.IsReached(static_cast<int>(i))) continue;
    for (size_t k = 0; k < spots.size(); ++k) {
      // A region is convex: its own middle sees it.
      if (k + 1 != i && !SeesRegion(space, roadmap.place(static_cast<int>(i)), spots[k])) continue;
      sees[i].push_back(k);
      to_see[k] = true;
    }
  }
  for (size_t k = 0; k < spots.size(); ++k) result->reachable_area_m2 += to_see[k] ? spots[k].area : 0;
  std::vector<int> places;
  const auto look_from = [&](size_t place) {
    places.push_back(static_cast<int>(place));
    for (const size_t k : sees[place]) {
      if (to_see[k]) result->seen_area_m2 += spots[k].area;
      to_see[k] = false;
    }
  };
  look_from(0);
  // [Simsarian96 §4.3] A path to every region is more than is needed: places that together see enough.
  while (result->seen_area_m2 < seen_ratio * result->reachable_area_m2 - 1e-9) {
    size_t best = 0;
    double most = 0;
    for (size_t i = 0; i < num; ++i) {
      double gain = 0;
      for (const size_t k : sees[i]) gain += to_see[k] ? spots[k].area : 0;
      if (gain <= most) continue;
      most = gain;
      best = i;
    }
    if (most <= 0) break;
    look_from(best);
  }
  return places;
}

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

}  // namespace

OptionTable DescribeOptions(PlanPathOptions* o) {
  return {
      {.name = "radius_m", .value = &o->radius_m, .help = "radius of the robot, metres", .min = 0, .max = 10},
      {.name = "max_num_places",
       .value = &o->max_num_places,
       .help =
           "about how many regions, spread over the plan, have their middles as turning and looking places",
       .min = 1,
       .max = 1e6},
      {.name = "seen_ratio",
       .value = &o->seen_ratio,
       .help = "share of the reachable area that a search path sees",
       .min = 1e-6,
       .max = 1},
  };
}

Result<PlanPath> FindPath(const PlanSpace& space, const Vec2& from, const Vec2& to,
                          const PlanPathOptions& options) {
  PlanPathOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_RETURN_IF_ERROR(CheckStands(space, from, options.radius_m));
  CAIRN_RETURN_IF_ERROR(CheckStands(space, to, options.radius_m));
  if (from == to) return PlanPath{{from}, 0};
  // [Simsarian96 §4.1] a low-cost path: over the visibility graph of the walls, not over the regions
  const PlanRoadmap roadmap(space, options.radius_m, {from, to});
  const std::vector<int> way = roadmap.ShortestWay(0, 1);
  if (way.empty()) return NoWay(from, to, options.radius_m);
  return Measured(PlacesOf(roadmap, way));
}

Result<PlanPath> FindMinimumLinkPath(const PlanSpace& space, const Vec2& from, const Vec2& to,
                                     const PlanPathOptions& options) {
  PlanPathOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_RETURN_IF_ERROR(CheckStands(space, from, options.radius_m));
  CAIRN_RETURN_IF_ERROR(CheckStands(space, to, options.radius_m));
  if (from == to) return PlanPath{{from}, 0};
  constexpr int kFrom = 0, kTo = 1;
  std::vector<Vec2> places{from, to};
  for (const Spot& spot : SpreadSpots(space.views(), options.max_num_places)) places.push_back(spot.middle);
  const PlanRoadmap roadmap(space, options.radius_m, places);
  std::vector<int> before(roadmap.num_nodes(), -1), order{kFrom};
  std::vector<bool> reached(roadmap.num_nodes(), false);
  reached[kFrom] = true;
  // [Simsarian96 §4.1] The fewest links: breadth first over nodes, not over weak visibility regions.  Nodes
  // of one level are tried in the order of their distance to the goal.
  for (size_t level = 0; level < order.size();) {
    const size_t end = order.size();
    for (size_t i = level; i < end; ++i) {
      if (!roadmap.AreJoined(order[i], kTo)) continue;
      std::vector<int> way{kTo};
      for (int at = order[i]; at >= 0; at = before[at]) way.push_back(at);
      std::reverse(way.begin(), way.end());
      return Measured(PlacesOf(roadmap, way));
    }
    for (size_t i = level; i < end; ++i) {
      for (int other = kTo + 1; other < roadmap.num_nodes(); ++other) {
        if (reached[other] || !roadmap.AreJoined(order[i], other)) continue;
        reached[other] = true;
        before[other] = order[i];
        order.push_back(other);
      }
    }
    level = end;
    const auto distance = [&](int node) { return (roadmap.place(node) - to).norm(); };
    std::stable_sort(order.begin() + static_cast<std::ptrdiff_t>(level), order.end(),
                     [&](int a, int b) { return distance(a) < distance(b); });
  }
  return NoWay(from, to, options.radius_m);
}

Result<SearchPath> FindSearchPath(const PlanSpace& space, const Vec2& from, const PlanPathOptions& options) {
  PlanPathOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_RETURN_IF_ERROR(CheckStands(space, from, options.radius_m));
  const std::vector<Spot> spots = SpreadSpots(space.views(), options.max_num_places);
  std::vector<Vec2> places{from};
  for (const Spot& spot : spots) places.push_back(spot.middle);
  const PlanRoadmap roadmap(space, options.radius_m, places);
  const RoadmapWays ways(roadmap);
  SearchPath result;
  const std::vector<int> looks =
      ChooseLookingPlaces(space, roadmap, ways, spots, options.seen_ratio, &result);
  const std::vector<int> tour = ShortTour(ways, looks);
  std::vector<Vec2> points{from};
  for (size_t i = 0; i < tour.size(); ++i) {
    result.places.push_back(roadmap.place(tour[i]));
    if (i == 0) continue;
    const std::vector<Vec2> leg = PlacesOf(roadmap, ways.Way(tour[i - 1], tour[i]));
    points.insert(points.end(), leg.begin() + 1, leg.end());
  }
  result.path = Measured(std::move(points));
  return result;
}

}  // namespace cairn
