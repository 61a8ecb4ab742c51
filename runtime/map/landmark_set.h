#pragma once

#include <optional>
#include <vector>

#include "core/blocks/map_rows.h"
#include "core/features/packed_descriptors.h"

namespace cairn {

// Some landmarks of a map, copied from its blocks for a query.
struct LandmarkSet {
  std::vector<LandmarkIdx> idx;        // ascending
  std::vector<MapLandmark> landmarks;  // of each
  DescriptorMatrix descriptors;        // row i: idx[i]
  PackedDescriptors packed;            // the same, for matching; empty where the set is not matched

  // REQUIRES: the landmark is in the set
  const MapLandmark& Find(LandmarkIdx landmark) const { return landmarks[Position(landmark)]; }
  size_t Position(LandmarkIdx landmark) const;
};

// Ascending, each once; of any indices.
void SortUnique(std::vector<LandmarkIdx>* landmarks);
// How many elements two ascending lists share.
int NumShared(const std::vector<LandmarkIdx>& a, const std::vector<LandmarkIdx>& b);

}  // namespace cairn
