#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "core/base/pooled.h"
#include "core/blocks/map_rows.h"
#include "core/features/packed_descriptors.h"

namespace cairn {

// Some landmarks of a map, copied from its blocks for a query.
struct LandmarkSet {
  PooledVector<LandmarkIdx> idx;        // ascending
  PooledVector<MapLandmark> landmarks;  // of each
  DescriptorMatrix descriptors;         // row i: idx[i]
  PackedDescriptors packed;             // the same, for matching; empty where the set is not matched

  // REQUIRES: the landmark is in the set
  const MapLandmark& Find(LandmarkIdx landmark) const { return landmarks[Position(landmark)]; }
  size_t Position(LandmarkIdx landmark) const;
};

// Ascending, each once; of any indices.
template <typename Allocator>
void SortUnique(std::vector<LandmarkIdx, Allocator>* landmarks) {
  std::sort(landmarks->begin(), landmarks->end());
  landmarks->erase(std::unique(landmarks->begin(), landmarks->end()), landmarks->end());
}
// How many elements two ascending lists share.
int NumShared(std::span<const LandmarkIdx> a, std::span<const LandmarkIdx> b);

}  // namespace cairn
