#pragma once

#include <string>
#include <vector>

#include "core/atlas/atlas_file.h"
#include "core/base/error.h"
#include "runtime/atlas/atlas.h"
#include "runtime/drive/route.h"

namespace cairn {

// A way through one of an atlas's maps, and the passage at its end.
struct AtlasLeg {
  int map = 0;
  Route route;
  std::string passage;  // to the next leg's map; empty at the goal
};

// The way of least cost from an image to another, through passages where they are of different maps or where
// a passage is shorter.  Errors: as PlanRoute and Atlas::OpenMap; InvalidArgument (no such map), NotFound (no
// passages lead from one map to the other).
Result<std::vector<AtlasLeg>> PlanRoute(const Atlas& atlas, const AtlasImage& from, const AtlasImage& to,
                                        const RouteOptions& options = {});

// The map that an image MAP/IMAGE is of, by the longest of the maps' names that it begins with, as both names
// may have slashes.  Errors: NotFound.
Result<int32_t> MapOfImage(const AtlasRows& atlas, const std::string& name);

// The image MAP/IMAGE, by the names of both.  Errors: as Atlas::FindMap, Atlas::OpenMap and FindImage.
Result<AtlasImage> FindImage(const Atlas& atlas, const std::string& name);

}  // namespace cairn
