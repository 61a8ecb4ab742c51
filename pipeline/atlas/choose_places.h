#pragma once

#include <cstdint>
#include <vector>

#include "core/atlas/descriptor_code.h"
#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// The landmarks by which a map is told from others, the most useful first: each image is to show some of
// them, their codes are to be the same from image to image, and few other maps are to have them.
// `num_maps_alike`: of each landmark, the other maps that have one which would be taken for it.
// Each next landmark adds most, a heap of what each added when it was last asked: O(observations log n).
std::vector<LandmarkIdx> RankLandmarks(const MapRows& rows, const std::vector<DescriptorCode>& codes,
                                       const std::vector<int>& num_maps_alike);

// The codes of these landmarks by places (AtlasMap::places): in the order of the images that see them.
std::vector<std::vector<uint32_t>> PlacesOf(const MapRows& rows, const std::vector<DescriptorCode>& codes,
                                            std::vector<LandmarkIdx> landmarks);

// As many of the ranked landmarks as take no more than `max_num_bytes` in an atlas, but `min_num_codes` of
// them anyway.
std::vector<std::vector<uint32_t>> ChoosePlaces(const MapRows& rows, const std::vector<DescriptorCode>& codes,
                                                const std::vector<LandmarkIdx>& ranked, size_t max_num_bytes,
                                                int min_num_codes);

}  // namespace cairn::pipeline
