#pragma once

#include <vector>

#include "core/blocks/map_rows.h"

namespace cairn {

// Distinct landmarks that the images taken at each station see.
std::vector<int> LandmarksSeenAt(const MapRows& rows);
// Of the landmarks whose entry in `counts` is not 0.
std::vector<int> LandmarksSeenAt(const MapRows& rows, const std::vector<char>& counts);

}  // namespace cairn
