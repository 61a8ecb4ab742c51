#pragma once

#include <vector>

#include "core/blocks/map_rows.h"

namespace cairn {

// Distinct landmarks that the images taken at each station see.
std::vector<int> LandmarksSeenAt(const MapRows& rows);
// The same, of landmarks whose entry in `counts` is not 0 only.
std::vector<int> LandmarksSeenAt(const MapRows& rows, const std::vector<char>& counts);

}  // namespace cairn
