#include "stages/decompose_regions/cover/cover.h"

#include <algorithm>
#include <limits>
#include <queue>
#include <utility>

namespace cairn::decompose_regions {
namespace {

// Larger count first, then smaller feature.
uint64_t HeapEntry(int32_t count, int32_t feature) {
  return static_cast<uint64_t>(count) << 32 |
         (std::numeric_limits<uint32_t>::max() - static_cast<uint32_t>(feature));
}

// Replaces the largest entry of a heap by a smaller one.
void ReplaceTop(uint64_t entry, std::vector<uint64_t>* heap) {
  size_t hole = 0;
  for (size_t child = 1; child < heap->size(); child = 2 * hole + 1) {
    if (child + 1 < heap->size() && (*heap)[child + 1] > (*heap)[child]) ++child;
    if ((*heap)[child] <= entry) break;
    (*heap)[hole] = (*heap)[child];
    hole = child;
  }
  (*heap)[hole] = entry;
}

}  // namespace

// [Sala06 Fig. 3 line 1, Fig. 4 line 1, Fig. 5 line 1] U = {v : |F_v| >= k}, D = {}
Cover::Cover(const ReducedWorld& world, int rho, Progress* progress)
    : world_(world),
      rho_(rho),
      progress_(progress),
      finder_(world.neighbours),
      open_(world.coverable),
      num_open_(world.num_coverable),
      cover_counts_(world.num_stations(), 0),
      xor_regions_(world.num_stations(), 0) {
  open_counts_.resize(world.areas.size());
  for (int32_t feature = 0; feature < world.areas.size(); ++feature) {
    open_counts_[feature] = static_cast<int32_t>(world.areas[feature].size());
    heap_.push_back(HeapEntry(open_counts_[feature], feature));
  }
  heap_counts_ = open_counts_;
  std::make_heap(heap_.begin(), heap_.end());
}

int32_t Cover::MostVisibleFeature() {
  for (;;) {
    const uint64_t top = heap_.front();
    const auto feature =
        static_cast<int32_t>(std::numeric_limits<uint32_t>::max() - static_cast<uint32_t>(top));
    const auto count = static_cast<int32_t>(top >> 32);
    if (count == open_counts_[feature] && count == heap_counts_[feature]) return feature;
    if (count == heap_counts_[feature]) {
      heap_counts_[feature] = open_counts_[feature];
      ReplaceTop(HeapEntry(open_counts_[feature], feature), &heap_);
    } else {
      std::pop_heap(heap_.begin(), heap_.end());
      heap_.pop_back();
    }
  }
}

void Cover::PushFeature(int32_t feature) {
  heap_counts_[feature] = open_counts_[feature];
  heap_.push_back(HeapEntry(open_counts_[feature], feature));
  std::push_heap(heap_.begin(), heap_.end());
}

void Cover::Open(StationIdx station) {
  open_[station] = 1;
  ++num_open_;
  for (const int32_t feature : world_.sets[station]) {
    if (++open_counts_[feature] > heap_counts_[feature]) PushFeature(feature);
  }
}

void Cover::Close(StationIdx station) {
  open_[station] = 0;
  --num_open_;
  for (const int32_t feature : world_.sets[station]) --open_counts_[feature];
}

int Cover::Add(const CoreRegion& region, int rho) {
  int num_gained = 0;
  // [Sala06 Fig. 3 line 15, Fig. 4 line 10, Fig. 5 line 14] U = U \ R, also where R is not added below
  for (const StationIdx station : region.stations) {
    num_gained += cover_counts_[station] == 0;
    if (open_[station]) Close(station);
  }
  // B.2 reopens stations: progress is the smallest number of open stations so far.
  if (const int num_closed = world_.num_coverable - num_open_; progress_ && num_closed > num_reported_) {
    progress_->Advance(num_closed - num_reported_);
    num_reported_ = num_closed;
  }
  // [Sala06 §V-E] R is added only where it covers more than rho stations that no other region covers
  if (num_gained <= rho) return 0;
  // [Sala06 Fig. 3 line 16, Fig. 4 line 11, Fig. 5 line 15] D = D u {R}
  const int idx = static_cast<int>(regions_.size());
  regions_.push_back(region);
  num_exclusive_.push_back(num_gained);
  changed_regions_.push_back(idx);
  for (const StationIdx station : region.stations) {
    if (cover_counts_[station]++ == 1) {
      --num_exclusive_[xor_regions_[station]];
      changed_regions_.push_back(xor_regions_[station]);
    }
    xor_regions_[station] ^= idx;
  }
  return num_gained;
}

void Cover::AddComponents(const std::vector<int32_t>& features, std::span<const StationIdx> stations) {
  for (std::vector<StationIdx>& component : finder_.Components(stations))
    Add({features, std::move(component)});
}

void Cover::Drop(int region) {
  for (const StationIdx station : regions_[region].stations) {
    xor_regions_[station] ^= region;
    if (--cover_counts_[station] == 0) {
      Open(station);
    } else if (cover_counts_[station] == 1) {
      ++num_exclusive_[xor_regions_[station]];
      changed_regions_.push_back(xor_regions_[station]);
    }
  }
  regions_[region] = {};
  num_exclusive_[region] = 0;
}

void DropRedundantRegions(Cover* cover) {
  // [Sala06 §V-D] mu(R) = min over v in R of |{R' in D : v in R'}|
  const auto min_overlap = [&](int region) {
    int overlap = std::numeric_limits<int>::max();
    for (const StationIdx station : cover->regions()[region].stations) {
      overlap = std::min(overlap, cover->NumRegionsAt(station));
    }
    return overlap;
  };
  // Overlap counts only fall, so an entry of the heap is an upper bound until it is updated.
  std::priority_queue<std::pair<int, int>> candidates;  // mu, -region
  for (int region = 0; region < static_cast<int>(cover->regions().size()); ++region) {
    if (!cover->IsDropped(region)) candidates.emplace(min_overlap(region), -region);
  }
  // [Sala06 §V-D] the region with the largest mu goes, while that leaves every station covered
  while (!candidates.empty() && candidates.top().first >= 2) {
    const auto [overlap, negative] = candidates.top();
    candidates.pop();
    if (const int current = min_overlap(-negative); current < overlap) {
      candidates.emplace(current, negative);
    } else {
      cover->Drop(-negative);
    }
  }
}

}  // namespace cairn::decompose_regions
