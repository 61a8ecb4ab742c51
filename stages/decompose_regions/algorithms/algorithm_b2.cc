// [Sala06 Fig. 4] Algorithm B.2: as B.1, but a new region pushes out regions that it makes
// nearly superfluous.
#include <queue>

#include "stages/decompose_regions/algorithms/algorithms.h"

namespace cairn::decompose_regions {
namespace {

// [Sala06 Fig. 4 line 12] Drops regions, the one that covers the fewest stations alone first (the source says
// "greedily", not by what), as long as the total number of stations that become unassigned stays below
// `num_gained`, the number that the new region covers and nothing covered before.
class Purge {
 public:
  explicit Purge(Cover* cover) : cover_(*cover) {}

  void Run(int num_gained) {
    int num_lost = 0;
    for (;;) {
      for (const int region : cover_.TakeChangedRegions()) {
        if (!cover_.IsDropped(region)) losses_.emplace(cover_.NumExclusive(region), region);
      }
      // Entries are stale where a region has changed since: it then has a newer entry.
      while (!losses_.empty() && IsStale(losses_.top())) losses_.pop();
      // [Sala06 Fig. 4 line 12, fn 4] Less is lost than gained: the number of assigned stations grows with
      // every region that is added, so the algorithm ends.
      if (losses_.empty() || num_lost + losses_.top().first >= num_gained) return;
      num_lost += losses_.top().first;
      cover_.Drop(losses_.top().second);
    }
  }

 private:
  using Entry = std::pair<int, int>;  // stations that only this region covers; region
  bool IsStale(const Entry& entry) const {
    return cover_.IsDropped(entry.second) || cover_.NumExclusive(entry.second) != entry.first;
  }

  Cover& cover_;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> losses_;
};

}  // namespace

void AlgorithmB2(Cover* cover) {
  FeatureChooser chooser(cover);
  Purge purge(cover);
  while (cover->HasOpen()) {                     // [Sala06 Fig. 4 line 2]
    const CoreRegion region = chooser.Choose();  // [Sala06 Fig. 4 lines 3-9]
    for (std::vector<StationIdx>& component : cover->Components(region.stations)) {
      const int num_gained =
          cover->Add({region.features, std::move(component)});  // [Sala06 Fig. 4 lines 10-11], subject to rho
      if (num_gained > 0) purge.Run(num_gained);                // [Sala06 Fig. 4 line 12]
    }
  }
}

}  // namespace cairn::decompose_regions
