#pragma once

#include <cstdint>
#include <vector>

#include "core/base/blob.h"
#include "core/blocks/map_rows.h"

namespace cairn {

// Which elements of one map another has too, whatever their numbers there: one that is taken out of the
// middle moves the numbers of all that follow, and all that names them.
struct Renumbering {
  static constexpr int32_t kNew = -1;

  // Per element of the other map: its index in the first, at most once, or kNew.
  std::vector<int32_t> landmarks, images, stations, nodes;
};

// Landmarks are the same where all that is stored of them is, images by id, stations by place and heading,
// nodes of the appearance graph by their first image.  O(n log n).
Renumbering FindSame(const MapRows& from, const MapRows& to);

// Renumbering::stations of FindSame.
std::vector<int32_t> FindSameStations(const MapRows& from, const MapRows& to);

// The first map's elements that the other one has, under the other one's numbers, and new ones empty (nodes
// with an entropy of 0, where its nodes have one): what
// both have in common is then equal.  Images, stations, station edges, regions (by their index), appearance
// nodes; what names an element that the other lacks is left out.
MapRows Renumbered(const MapRows& from, const Renumbering& renumbering);

void WriteRenumbering(const Renumbering& renumbering, BlobWriter* writer);
// Each index is in range of `from`, and none is taken twice; reader->ok() is false otherwise, and where there
// are more than `max_num_elements` of a kind.
Renumbering ReadRenumbering(const MapRows& from, int64_t max_num_elements, BlobReader* reader);

}  // namespace cairn
