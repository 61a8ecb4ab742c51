#include "runtime/paths/plan_path.h"

#include <algorithm>

#include "runtime/paths/fewest_links.h"
#include "runtime/paths/link_space.h"
#include "runtime/paths/plan_roadmap.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

Error NoWay(const Vec2& from, const Vec2& to, double radius_m) {
  return MakeError(ErrorCode::kNoData,
                   "no way from ({:g}, {:g}) to ({:g}, {:g}) for a robot of radius {:g} m", from.x(),
                   from.y(), to.x(), to.y(), radius_m);
}

// The path in metres; empty where it is none, or comes nearer to a wall than the robot may.
std::vector<Vec2> CheckedPath(const PlanSpace& space, double radius_m, const Vec2& from, const Vec2& to,
                              const LinkedPath& path) {
  if (path.num_links == 0) return {};
  std::vector<Vec2> points;
  for (const Vec2& point : path.points) points.push_back(space.views().plan.Metres(point.x(), point.y()));
  points.front() = from;
  points.back() = to;
  for (size_t i = 0; i + 1 < points.size(); ++i) {
    const bool is_free = radius_m > 0 ? space.IsFree(points[i], points[i + 1], radius_m)
                                      : space.IsFree(points[i], points[i], 0) &&
                                            space.PassageBetween(points[i], points[i + 1]).IsOpen();
    if (!is_free) return {};
  }
  return points;
}

// A way with the fewest links of those that turn at nodes of a roadmap; empty: there is none.  Breadth first.
std::vector<int> FewestLinksOver(const PlanRoadmap& roadmap, int from, int to) {
  std::vector<int> before(roadmap.num_nodes(), -1), order{from};
  std::vector<bool> reached(roadmap.num_nodes(), false);
  reached[from] = true;
  for (size_t i = 0; i < order.size() && !reached[to]; ++i) {
    for (int next = 0; next < roadmap.num_nodes(); ++next) {
      if (reached[next] || !roadmap.AreJoined(order[i], next)) continue;
      reached[next] = true;
      before[next] = order[i];
      order.push_back(next);
    }
  }
  std::vector<int> way;
  for (int at = reached[to] ? to : -1; at >= 0; at = before[at]) way.push_back(at);
  std::reverse(way.begin(), way.end());
  return way;
}

void TakeFewerLinks(std::vector<Vec2> points, MinimumLinkPath* result) {
  PlanPath path = MeasuredPath(std::move(points));
  if (path.num_links() > 0 && path.num_links() < result->path.num_links()) result->path = std::move(path);
}

}  // namespace

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

PlanPath MeasuredPath(std::vector<Vec2> points) {
  PlanPath path{std::move(points), 0};
  for (size_t i = 0; i + 1 < path.points.size(); ++i)
    path.length_m += (path.points[i + 1] - path.points[i]).norm();
  return path;
}

OptionTable DescribeOptions(PlanPathOptions* o) {
  return {
      {.name = "radius_m", .value = &o->radius_m, .help = "radius of the robot, metres", .min = 0, .max = 10},
      {.name = "max_num_places",
       .value = &o->max_num_places,
       .help = "about how many regions, spread over the plan, have their middles as looking places to choose "
               "from",
       .min = 1,
       .max = 1e6},
      {.name = "seen_ratio",
       .value = &o->seen_ratio,
       .help = "share of what can be seen at all that a search path sees",
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
  return MeasuredPath(roadmap.Places(way));
}

Result<MinimumLinkPath> FindMinimumLinkPath(const PlanSpace& space, const Vec2& from, const Vec2& to,
                                            const PlanPathOptions& options) {
  // All kinds agree on whether there is a way.
  CAIRN_ASSIGN_OR_RETURN(PlanPath shortest, FindPath(space, from, to, options));
  MinimumLinkPath result{std::move(shortest), 0};
  if (from == to) return result;
  const double radius_m = options.radius_m;
  const LinkSpace outer(space, radius_m, LinkSpace::Bound::kOuter, from, to);
  result.fewest_links = std::clamp(FindFewestLinks(outer).num_links, 1, result.path.num_links());
  if (!result.is_optimal()) {
    const LinkSpace inner(space, radius_m, LinkSpace::Bound::kInner, from, to);
    TakeFewerLinks(CheckedPath(space, radius_m, from, to, FindFewestLinks(inner)), &result);
  }
  // Ways that touch walls on both sides turn at corners, if at all.
  if (!result.is_optimal()) {
    const PlanRoadmap roadmap(space, radius_m, {from, to});
    TakeFewerLinks(roadmap.Places(FewestLinksOver(roadmap, 0, 1)), &result);
  }
  return result;
}

}  // namespace cairn
