#pragma once

#include <cstdint>
#include <vector>

#include "core/error.h"
#include "runtime/map.h"

namespace cairn {

// A way from image to image along which each shows what the next one shows: a robot that can steer by its
// camera follows it without a metric map [Booij06 §I].
struct Route {
  std::vector<int32_t> images;  // indices: the start, then one per place on the way, then the goal
  int num_links = 0;            // between places; 0: start and goal were taken at one place
};

// The way of fewest links over the kept images of the map's appearance graph, of such ways the one through
// the smallest nodes; start and goal may be images that are not kept [Booij06 §IV: paths over the connected
// dominating set].  O(images + links).  Errors: InvalidArgument (no such image), NotFound (the map has no
// appearance graph; one of the images is not in it; no path leads from one to the other), Corrupt (a damaged
// block).
Result<Route> PlanRoute(const Map& map, int32_t from, int32_t to);

}  // namespace cairn
