#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/progress.h"
#include "stages/decompose_regions/cover/reduced_world.h"

namespace cairn::decompose_regions {

// A region of the reduced world, before it is grown by tau.
struct CoreRegion {
  std::vector<int32_t> features;     // reduced features that all stations see
  std::vector<StationIdx> stations;  // connected, ascending
};

// The state that all six algorithms share: the open stations U, the regions D, and how many regions each
// station has.  Invariants: open_counts[f] = |{v in U : f in F_v}|; cover_counts[v] = |{R in D : v in R}|;
// num_exclusive of a region = number of its stations that no other region covers.
class Cover {
 public:
  // U = { v : |F_v| >= k }, D = {}.  `progress`, if any, advances by the stations that leave U for the
  // first time.
  Cover(const ReducedWorld& world, int rho, Progress* progress = nullptr);

  const ReducedWorld& world() const { return world_; }
  bool IsOpen(StationIdx station) const { return open_[station] != 0; }
  int num_open() const { return num_open_; }
  // Whether an algorithm still has something to do: a station is open, and it was not cancelled.
  bool HasOpen() const { return num_open_ > 0 && !(progress_ && progress_->Cancelled()); }
  // Number of open stations that see a feature.
  int OpenCount(int32_t feature) const { return open_counts_[feature]; }
  // The feature that most open stations see; the first of equal ones.  REQUIRES: num_open() > 0
  int32_t MostVisibleFeature();

  // U = U \ R; D = D u {R} if R covers more than rho stations that no region covers [Sala06 §V-E].  Returns
  // the number of those if the region was added, else 0.  REQUIRES: R is connected
  int Add(const CoreRegion& region) { return Add(region, rho_); }
  int Add(const CoreRegion& region, int rho);
  // The same for each connected component of a set of stations.
  void AddComponents(const std::vector<int32_t>& features, std::span<const StationIdx> stations);
  std::vector<std::vector<StationIdx>> Components(std::span<const StationIdx> stations) {
    return finder_.Components(stations);
  }

  // U = U u {v}, U = U \ {v}: for work on a part of the stations.
  // REQUIRES: v is coverable; not open before Open, open before Close
  void Open(StationIdx station);
  void Close(StationIdx station);

  // D = D \ {R}; stations that no region covers any more go back into U.
  void Drop(int region);

  // Regions by index in the order in which they were added; dropped ones are empty.
  const std::vector<CoreRegion>& regions() const { return regions_; }
  bool IsDropped(int region) const { return regions_[region].stations.empty(); }
  int NumRegionsAt(StationIdx station) const { return cover_counts_[station]; }
  int NumExclusive(int region) const { return num_exclusive_[region]; }
  // Regions whose num_exclusive may have changed since the last call, with duplicates.
  std::vector<int> TakeChangedRegions() { return std::exchange(changed_regions_, {}); }

 private:
  void PushFeature(int32_t feature);

  const ReducedWorld& world_;
  const int rho_;
  Progress* const progress_;
  int num_reported_ = 0;
  ComponentFinder finder_;
  std::vector<char> open_;
  int num_open_ = 0;
  std::vector<int32_t> open_counts_;
  // Heap of features by open_counts, evaluated lazily: an entry's count is an upper bound, its feature's only
  // valid entry is the one that equals heap_counts[feature].
  std::vector<uint64_t> heap_;
  std::vector<int32_t> heap_counts_;

  std::vector<CoreRegion> regions_;
  std::vector<int32_t> cover_counts_;
  std::vector<int32_t> xor_regions_;  // XOR of the regions that cover a station: with one region, that region
  std::vector<int> num_exclusive_;
  std::vector<int> changed_regions_;
};

// [Sala06 §V-D] While some region can go, drops the one with the largest minimum overlap count
//   mu(R) = min over v in R of |{R' in D : v in R'}|;
// mu >= 2 leaves every station covered.  Among equals the one that was added first is dropped.
void DropRedundantRegions(Cover* cover);

// Covers part of every connected set of more than `max_hole` coverable stations that no region covers, until
// none is left: in each such set, B.1 chooses a region, whatever its size.  REQUIRES: num_open() == 0.  The
// rule of rho does not bound holes: remainders that were dropped one by one can lie side by side.  Returns
// whether a region was added.
bool LimitHoles(int max_hole, Cover* cover);

}  // namespace cairn::decompose_regions
