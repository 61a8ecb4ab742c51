#include "runtime/atlas/atlas_route.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

namespace cairn {
namespace {

// The start, the goal, then both ends of every passage in turn.
std::vector<AtlasImage> Stops(const AtlasRows& atlas, const AtlasImage& from, const AtlasImage& to) {
  std::vector<AtlasImage> stops = {from, to};
  for (const AtlasPassage& passage : atlas.passages) {
    stops.push_back(passage.from);
    stops.push_back(passage.to);
  }
  return stops;
}

constexpr size_t kStart = 0, kGoal = 1, kFirstOfPassage = 2;
// The passage that two stops are the ends of; -1: of none.
int PassageBetween(size_t a, size_t b) {
  if (std::min(a, b) < kFirstOfPassage || (a ^ 1) != b) return -1;
  return static_cast<int>((a - kFirstOfPassage) / 2);
}

// How a stop is reached for the least cost known so far.
struct Reached {
  double cost = std::numeric_limits<double>::infinity();
  size_t before = kStart;
  Route route;  // from there; without images: over a passage
  bool is_final = false;
};

}  // namespace

// Dijkstra over the ends of passages, of which there are few.
Result<std::vector<AtlasLeg>> PlanRoute(const Atlas& atlas, const AtlasImage& from, const AtlasImage& to,
                                        const RouteOptions& options) {
  for (const AtlasImage& image : {from, to}) {
    if (image.map < 0 || image.map >= atlas.num_maps())
      return MakeError(ErrorCode::kInvalidArgument, "route: map {} of {}", image.map, atlas.num_maps());
  }
  const std::vector<AtlasImage> stops = Stops(atlas.rows(), from, to);
  std::vector<Reached> reached(stops.size());
  reached[kStart].cost = 0;
  std::optional<Error> no_way;  // within the map of the start or of the goal
  while (!reached[kGoal].is_final) {
    size_t next = stops.size();
    for (size_t stop = 0; stop < stops.size(); ++stop) {
      if (!reached[stop].is_final && (next == stops.size() || reached[stop].cost < reached[next].cost))
        next = stop;
    }
    if (next == stops.size() || reached[next].cost == std::numeric_limits<double>::infinity()) {
      if (from.map == to.map && no_way) return *no_way;
      return MakeError(
          ErrorCode::kNotFound,
          "route: no passages lead from map '{}' to map '{}'; `cairn atlas --passages` states them",
          atlas.map_name(from.map), atlas.map_name(to.map));
    }
    reached[next].is_final = true;
    const auto reach = [&](size_t stop, double cost, Route route) {
      if (reached[next].cost + cost < reached[stop].cost)
        reached[stop] = {.cost = reached[next].cost + cost, .before = next, .route = std::move(route)};
    };
    for (size_t stop = 0; stop < stops.size(); ++stop) {
      if (reached[stop].is_final) continue;
      if (const int passage = PassageBetween(next, stop); passage >= 0)
        reach(stop, atlas.rows().passages[passage].cost, {});
      if (stops[stop].map != stops[next].map) continue;
      CAIRN_ASSIGN_OR_RETURN(const auto map, atlas.OpenMap(stops[next].map));
      Result<Route> route = PlanRoute(*map, stops[next].image, stops[stop].image, options);
      if (route.ok()) {
        const double cost = route->cost;
        reach(stop, cost, *std::move(route));
      } else if (route.error().code == ErrorCode::kNotFound) {
        no_way = route.error();
      } else {
        return route.error();
      }
    }
  }
  std::vector<AtlasLeg> legs;
  std::string passage;  // at the end of the leg that is found next, back from the goal
  for (size_t stop = kGoal; stop != kStart; stop = reached[stop].before) {
    const size_t before = reached[stop].before;
    if (reached[stop].route.images.empty()) {
      passage = atlas.rows().passages[PassageBetween(before, stop)].name;
    } else {
      legs.push_back({stops[stop].map, std::move(reached[stop].route), std::exchange(passage, "")});
    }
  }
  std::reverse(legs.begin(), legs.end());
  return legs;
}

Result<int32_t> MapOfImage(const AtlasRows& atlas, const std::string& name) {
  int32_t found = -1;
  for (size_t map = 0; map < atlas.maps.size(); ++map) {
    const std::string& map_name = atlas.maps[map].name;
    if (name.starts_with(map_name + "/") && (found < 0 || map_name.size() > atlas.maps[found].name.size()))
      found = static_cast<int32_t>(map);
  }
  if (found >= 0) return found;
  return MakeError(ErrorCode::kNotFound,
                   "'{}' is of none of the maps; write MAP/IMAGE, with the name of one of them (of an atlas, "
                   "`cairn inspect` lists them)",
                   name);
}

Result<AtlasImage> FindImage(const Atlas& atlas, const std::string& name) {
  CAIRN_ASSIGN_OR_RETURN(const int32_t found, MapOfImage(atlas.rows(), name));
  CAIRN_ASSIGN_OR_RETURN(const auto map, atlas.OpenMap(found));
  CAIRN_ASSIGN_OR_RETURN(const int32_t image, FindImage(*map, name.substr(atlas.map_name(found).size() + 1)));
  return AtlasImage{found, image};
}

}  // namespace cairn
