#include "runtime/plan_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <queue>

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

Error NoWay(const Vec2& from, const Vec2& to, double radius_m) {
  return MakeError(ErrorCode::kNoData,
                   "no way from ({:g}, {:g}) to ({:g}, {:g}) for a robot of radius {:g} m", from.x(),
                   from.y(), to.x(), to.y(), radius_m);
}

PlanPath Measured(std::vector<Vec2> points) {
  PlanPath path{std::move(points), 0};
  for (size_t i = 0; i + 1 < path.points.size(); ++i)
    path.length_m += (path.points[i + 1] - path.points[i]).norm();
  return path;
}

// A region that stands for those around it.
struct Spot {
  FaceIdx face = 0;
  Vec2 middle = Vec2::Zero();
  double area = 0;  // of all regions that it stands for
};

// All regions if there are no more than `most`; otherwise the largest of each cell of a grid with about as
// many cells, standing for all with their middles in the cell.
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
  if (!space.IsFree(place, spot.middle, 0)) return false;
  const Views& views = space.views();
  for (int64_t i = views.face_offsets[spot.face]; i < views.face_offsets[spot.face + 1]; ++i) {
    // A little inside, where no wall begins.
    const Vec2 corner = views.plan.Metres(views.vertices[views.face_vertices[i]]);
    if (!space.IsFree(place, corner + 1e-3 * (spot.middle - corner), 0)) return false;
  }
  return true;
}

// Places joined by free straight ways, and the shortest ways over them.  Place 0 is the start.
class Roadmap {
 public:
  Roadmap(const PlanSpace& space, std::vector<Vec2> points, double radius_m)
      : points_(std::move(points)), ways_(points_.size()) {
    for (size_t i = 0; i < points_.size(); ++i) {
      for (size_t k = 0; k < i; ++k) {
        if (!space.IsFree(points_[i], points_[k], radius_m)) continue;
        ways_[i].push_back(static_cast<int>(k));
        ways_[k].push_back(static_cast<int>(i));
      }
    }
    Lengths(0, &from_start_, nullptr);
  }

  const std::vector<Vec2>& points() const { return points_; }
  bool IsReached(size_t place) const { return std::isfinite(from_start_[place]); }

  // Dijkstra: lengths of the shortest ways from a place to all, and the place before each.
  void Lengths(int from, std::vector<double>* lengths, std::vector<int>* before) const {
    lengths->assign(points_.size(), std::numeric_limits<double>::infinity());
    if (before != nullptr) before->assign(points_.size(), -1);
    (*lengths)[from] = 0;
    using Entry = std::pair<double, int>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    queue.push({0, from});
    while (!queue.empty()) {
      const auto [length, at] = queue.top();
      queue.pop();
      if (length > (*lengths)[at]) continue;
      for (const int next : ways_[at]) {
        const double sum = length + (points_[next] - points_[at]).norm();
        if (sum >= (*lengths)[next]) continue;
        (*lengths)[next] = sum;
        if (before != nullptr) (*before)[next] = at;
        queue.push({sum, next});
      }
    }
  }

  std::vector<Vec2> Way(int from, int to) const {
    std::vector<double> lengths;
    std::vector<int> before;
    Lengths(from, &lengths, &before);
    std::vector<Vec2> points;
    for (int at = to; at >= 0; at = before[at]) points.push_back(points_[at]);
    std::reverse(points.begin(), points.end());
    return points;
  }

 private:
  std::vector<Vec2> points_;
  std::vector<std::vector<int>> ways_;
  std::vector<double> from_start_;
};

// Reached places that add the most area to what is seen, the start first, until enough is seen.
std::vector<int> ChooseLookingPlaces(const PlanSpace& space, const Roadmap& roadmap,
                                     const std::vector<Spot>& spots, double seen_ratio, SearchPath* result) {
  const std::vector<Vec2>& points = roadmap.points();
  const size_t num = points.size();
  std::vector<std::vector<size_t>> sees(num);
  std::vector<bool> to_see(spots.size(), false);
  for (size_t i = 0; i < num; ++i) {
    if (!roadmap.IsReached(i)) continue;
    for (size_t k = 0; k < spots.size(); ++k) {
      // A region is convex: its own middle sees it.
      if (k + 1 != i && !SeesRegion(space, points[i], spots[k])) continue;
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
std::vector<int> ShortTour(const Roadmap& roadmap, const std::vector<int>& places) {
  const size_t num = places.size();
  std::vector<std::vector<double>> legs(num);
  for (size_t i = 0; i < num; ++i) {
    std::vector<double> lengths;
    roadmap.Lengths(places[i], &lengths, nullptr);
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
  CAIRN_RETURN_IF_ERROR(space.CheckInside(from));
  CAIRN_RETURN_IF_ERROR(space.CheckInside(to));
  const auto is_free = [&](const Vec2& a, const Vec2& b) { return space.IsFree(a, b, options.radius_m); };
  const FaceIdx first = space.FaceAt(from), goal = space.FaceAt(to);
  if (space.IsFree(from, to, options.radius_m)) return Measured({from, to});
  struct Step {
    double length;
    FaceIdx face;
    Vec2 place;
    int before;
  };
  std::vector<Step> steps{{0, first, from, -1}};
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  queue.push({(to - from).norm(), 0});
  std::vector<bool> done(space.views().num_faces(), false);
  while (!queue.empty()) {
    const int at = queue.top().second;
    queue.pop();
    const Step step = steps[at];
    if (done[step.face]) continue;
    if (step.face == goal && !space.IsFree(step.place, to, options.radius_m)) continue;
    done[step.face] = true;
    if (step.face == goal) {
      std::vector<Vec2> points{to};
      for (int i = at; i >= 0; i = steps[i].before) points.push_back(steps[i].place);
      std::reverse(points.begin(), points.end());
      return Measured(Tightened(points, is_free));
    }
    for (auto* next = space.NeighboursBegin(step.face); next != space.NeighboursEnd(step.face); ++next) {
      if (done[next->face] || !space.IsFree(step.place, next->middle, options.radius_m)) continue;
      const double length = step.length + (next->middle - step.place).norm();
      steps.push_back({length, next->face, next->middle, at});
      queue.push({length + (to - next->middle).norm(), static_cast<int>(steps.size()) - 1});
    }
  }
  return NoWay(from, to, options.radius_m);
}

Result<PlanPath> FindMinimumLinkPath(const PlanSpace& space, const Vec2& from, const Vec2& to,
                                     const PlanPathOptions& options) {
  PlanPathOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_RETURN_IF_ERROR(space.CheckInside(from));
  CAIRN_RETURN_IF_ERROR(space.CheckInside(to));
  std::vector<Vec2> places{from};
  for (const Spot& spot : SpreadSpots(space.views(), options.max_num_places)) places.push_back(spot.middle);
  std::vector<int> before(places.size(), -1), order{0};
  std::vector<bool> reached(places.size(), false);
  reached[0] = true;
  // Places of one level are tried in the order of their distance to the goal.
  for (size_t level = 0; level < order.size();) {
    const size_t end = order.size();
    for (size_t i = level; i < end; ++i) {
      if (!space.IsFree(places[order[i]], to, options.radius_m)) continue;
      std::vector<Vec2> points{to};
      for (int at = order[i]; at >= 0; at = before[at]) points.push_back(places[at]);
      std::reverse(points.begin(), points.end());
      return Measured(std::move(points));
    }
    for (size_t i = level; i < end; ++i) {
      for (size_t other = 0; other < places.size(); ++other) {
        if (reached[other] || !space.IsFree(places[order[i]], places[other], options.radius_m)) continue;
        reached[other] = true;
        before[other] = order[i];
        order.push_back(static_cast<int>(other));
      }
    }
    level = end;
    std::stable_sort(order.begin() + static_cast<std::ptrdiff_t>(level), order.end(),
                     [&](int a, int b) { return (places[a] - to).norm() < (places[b] - to).norm(); });
  }
  return NoWay(from, to, options.radius_m);
}

Result<SearchPath> FindSearchPath(const PlanSpace& space, const Vec2& from, const PlanPathOptions& options) {
  PlanPathOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_RETURN_IF_ERROR(space.CheckInside(from));
  const std::vector<Spot> spots = SpreadSpots(space.views(), options.max_num_places);
  std::vector<Vec2> middles{from};
  for (const Spot& spot : spots) middles.push_back(spot.middle);
  const Roadmap roadmap(space, std::move(middles), options.radius_m);
  SearchPath result;
  const std::vector<int> looks = ChooseLookingPlaces(space, roadmap, spots, options.seen_ratio, &result);
  const std::vector<int> tour = ShortTour(roadmap, looks);
  const auto is_free = [&](const Vec2& a, const Vec2& b) { return space.IsFree(a, b, options.radius_m); };
  std::vector<Vec2> points{from};
  for (size_t i = 0; i < tour.size(); ++i) {
    result.places.push_back(roadmap.points()[tour[i]]);
    if (i == 0) continue;
    const std::vector<Vec2> way = Tightened(roadmap.Way(tour[i - 1], tour[i]), is_free);
    points.insert(points.end(), way.begin() + 1, way.end());
  }
  result.path = Measured(std::move(points));
  return result;
}

}  // namespace cairn
