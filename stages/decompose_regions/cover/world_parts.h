#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/decompose_regions/cover/cover.h"
#include "stages/decompose_regions/cover/reduced_world.h"

namespace cairn::decompose_regions {

// Large worlds are covered part by part.  All worlds here are reduced with AreaSplit::kBeforeShrinking.

// Parts between which no region passes: the components of the graph of stations, of whose edges only those
// are left whose two stations see k features in common.  A region is connected, and all of its stations see
// its k features, so it lies in one part, and a smallest decomposition consists of smallest ones of the
// parts. Only parts with coverable stations, by their first station; each ascending.  O(edges * features of a
// station).
std::vector<std::vector<StationIdx>> IndependentParts(const ReducedWorld& wide);

// Some stations of a world as a world of its own, in the same order.
struct WorldPart {
  ReducedWorld world;
  std::vector<StationIdx> stations;  // per station: the whole's
  std::vector<int32_t> features;     // per feature: the whole's; those that an open station sees
  // In the numbers of the whole, and of the part; features and stations that this has not are left out.
  CoreRegion InWhole(const CoreRegion& core) const;
  CoreRegion InPart(const CoreRegion& core) const;
};

// The part's coverable stations are the open ones: the others are in no area, regions only pass through them.
// So each of its regions is one of the whole, or what of it lies in the part; its core may have more stations
// there.  `open`: coverable ones of `stations`.  Both ascending.
WorldPart CutOut(const ReducedWorld& wide, std::vector<StationIdx> stations,
                 std::span<const StationIdx> open);

}  // namespace cairn::decompose_regions
