#include <utility>

#include "stages/decompose_regions/algorithms/algorithms.h"

namespace cairn::decompose_regions {
namespace {

using StationSet = std::vector<StationIdx>;

// The connected parts of `stations` that no region covers and that are larger than `max_hole`.
void AppendHoles(const StationSet& stations, int max_hole, Cover* cover, std::vector<StationSet>* holes) {
  StationSet uncovered;
  for (const StationIdx station : stations) {
    if (cover->world().coverable[station] && cover->NumRegionsAt(station) == 0) uncovered.push_back(station);
  }
  for (StationSet& hole : cover->Components(uncovered)) {
    if (static_cast<int>(hole.size()) > max_hole) holes->push_back(std::move(hole));
  }
}

}  // namespace

bool LimitHoles(int max_hole, Cover* cover) {
  StationSet all(cover->world().num_stations());
  for (StationIdx station = 0; station < cover->world().num_stations(); ++station) all[station] = station;
  std::vector<StationSet> holes;
  AppendHoles(all, max_hole, cover, &holes);
  if (holes.empty()) return false;
  FeatureChooser chooser(cover);
  while (!holes.empty()) {
    const StationSet hole = std::move(holes.back());
    holes.pop_back();
    for (const StationIdx station : hole) cover->Open(station);
    const CoreRegion region = chooser.Choose();  // [Sala06 Fig. 4 lines 3-9] with U = the hole
    for (StationSet& component : cover->Components(region.stations)) {
      cover->Add({region.features, std::move(component)}, 0);
    }
    for (const StationIdx station : hole) {
      if (cover->IsOpen(station)) cover->Close(station);
    }
    AppendHoles(hole, max_hole, cover, &holes);
  }
  return true;
}

}  // namespace cairn::decompose_regions
