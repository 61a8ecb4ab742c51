#pragma once

#include <cstdint>
#include <vector>

#include "core/atlas/atlas_file.h"
#include "core/features/features.h"

namespace cairn {

// How much of an image is known from one of an atlas's maps.
struct MapScore {
  int32_t map = 0;
  // Evidence, nats: how improbable it is that one of the map's places has by chance as many of the image's
  // features as the best one has.
  double score = 0;
  // These features of the image, ascending.
  std::vector<int32_t> features;
};

// The codes of all maps of an atlas, by their first half.
class CodeIndex {
 public:
  explicit CodeIndex(const AtlasRows& atlas);

  // All maps, the most evidence first; none for an image without features.  The largest features count: codes
  // are of landmarks that are seen from far away, too.  O(features), some 30 places of the index for each.
  std::vector<MapScore> Rank(const Features& features) const;

  // The maps that have a landmark of this code, ascending.
  std::vector<int32_t> MapsWith(const DescriptorCode& code) const;

 private:
  // Positions in `entries_`.
  std::vector<int32_t> Find(const DescriptorCode& code) const;
  struct Entry {
    uint32_t code;
    int32_t place;  // of all maps'
  };
  CodeBook code_book_;
  std::vector<int32_t> map_of_place_;
  std::vector<int32_t> first_;  // of each prefix: its first entry, and the number of all
  std::vector<Entry> entries_;  // ascending
};

}  // namespace cairn
