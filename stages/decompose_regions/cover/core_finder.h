#pragma once

#include <optional>
#include <span>
#include <vector>

#include "stages/decompose_regions/cover/cover.h"
#include "stages/decompose_regions/cover/reduced_world.h"

namespace cairn::decompose_regions {

// Represents regions of the world by the stations that they cover.  The core of a region R is { v coverable :
// N_tau(v) inside of R }.  For k features of a world reduced with AreaSplit::kBeforeShrinking let X be the
// common part of their shrunk areas and Q the components of the common part of their whole areas.  Then
//   - each Q is a region, and its core is X n Q: N_tau(v) is connected, so it lies in Q as soon as v does;
//   - every region R with k common features lies in one such Q, so its core lies in the core of Q:
// the cores found here, connected or not, are all that a smallest decomposition needs.
class CoreFinder {
 public:
  explicit CoreFinder(const ReducedWorld& wide);

  // X n Q for each Q that X meets.
  std::vector<std::vector<StationIdx>> Cores(std::span<const int32_t> features);
  // The core, seen in this world, of a region given by the world's features and some stations that it covers;
  // a superset of these stations.
  CoreRegion Widened(const std::vector<FeatureIdx>& world_features, const std::vector<StationIdx>& stations);
  // A region of the world with this core: the core grown by tau, or Q where that is not connected.
  std::vector<StationIdx> RegionOf(const CoreRegion& core, int tau);

 private:
  const ReducedWorld& wide_;
  ComponentFinder finder_;
};

}  // namespace cairn::decompose_regions
