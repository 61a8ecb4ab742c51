#include "stages/decompose_regions/cover/world_parts.h"

#include <algorithm>
#include <iterator>

namespace cairn::decompose_regions {
namespace {

// Whether two ascending lists have `num` values in common.
bool HaveInCommon(std::span<const int32_t> a, std::span<const int32_t> b, int num) {
  for (size_t i = 0, j = 0; i < a.size() && j < b.size() && num > 0;) {
    if (a[i] == b[j]) {
      ++i, ++j, --num;
    } else {
      ++(a[i] < b[j] ? i : j);
    }
  }
  return num <= 0;
}

// Of ascending values: where each of `all` that is in `some` stands there.
template <typename Values>
std::vector<int32_t> PlacesOf(const Values& all, std::span<const int32_t> some) {
  std::vector<int32_t> places;
  for (const int32_t value : some) {
    const auto found = std::lower_bound(all.begin(), all.end(), value);
    if (found != all.end() && *found == value) places.push_back(static_cast<int32_t>(found - all.begin()));
  }
  return places;
}

}  // namespace

std::vector<std::vector<StationIdx>> IndependentParts(const ReducedWorld& wide) {
  const IndexLists seen = wide.whole_areas.Transposed(wide.num_stations());
  std::vector<std::vector<StationIdx>> parts;
  std::vector<char> is_visited(wide.num_stations(), 0);
  for (StationIdx first = 0; first < wide.num_stations(); ++first) {
    if (is_visited[first]) continue;
    is_visited[first] = 1;
    std::vector<StationIdx> part = {first};
    for (size_t i = 0; i < part.size(); ++i) {
      for (const StationIdx next : wide.neighbours[part[i]]) {
        if (is_visited[next] || !HaveInCommon(seen[part[i]], seen[next], wide.k)) continue;
        is_visited[next] = 1;
        part.push_back(next);
      }
    }
    if (std::none_of(part.begin(), part.end(), [&](StationIdx s) { return wide.coverable[s] != 0; }))
      continue;
    std::sort(part.begin(), part.end());
    parts.push_back(std::move(part));
  }
  return parts;
}

CoreRegion WorldPart::InWhole(const CoreRegion& core) const {
  CoreRegion whole;
  for (const int32_t feature : core.features) whole.features.push_back(features[feature]);
  for (const StationIdx station : core.stations) whole.stations.push_back(stations[station]);
  return whole;
}

CoreRegion WorldPart::InPart(const CoreRegion& core) const {
  return {PlacesOf(features, core.features), PlacesOf(stations, core.stations)};
}

WorldPart CutOut(const ReducedWorld& wide, std::vector<StationIdx> stations,
                 std::span<const StationIdx> open) {
  WorldPart part;
  part.stations = std::move(stations);
  for (const StationIdx station : open)
    part.features.insert(part.features.end(), wide.sets[station].begin(), wide.sets[station].end());
  std::sort(part.features.begin(), part.features.end());
  part.features.erase(std::unique(part.features.begin(), part.features.end()), part.features.end());
  const auto num_stations = static_cast<int>(part.stations.size());
  std::vector<int32_t> kept;
  const auto keep = [&](std::span<const StationIdx> some, const std::vector<char>* which) {
    kept = PlacesOf(part.stations, some);
    if (which != nullptr) std::erase_if(kept, [&](int32_t i) { return (*which)[i] == 0; });
    return std::span<const int32_t>(kept);
  };
  ReducedWorld& world = part.world;
  world.k = wide.k;
  world.coverable.assign(num_stations, 0);
  for (const int32_t i : PlacesOf(part.stations, open)) world.coverable[i] = 1;
  world.num_coverable = static_cast<int>(open.size());
  for (const StationIdx station : part.stations)
    world.neighbours.Append(keep(wide.neighbours[station], nullptr));
  for (const int32_t feature : part.features) {
    world.areas.Append(keep(wide.areas[feature], &world.coverable));
    world.whole_areas.Append(keep(wide.whole_areas[feature], nullptr));
    world.original.push_back(wide.original[feature]);
  }
  world.sets = world.areas.Transposed(num_stations);
  return part;
}

}  // namespace cairn::decompose_regions
