#pragma once

#include <string>

#include "core/colmap/colmap_model.h"

namespace cairn::reconstruct {

// Says where a reconstructed drive, whose images follow each other by name, goes in steps that are four times
// as long or as short as others', over 25 of them: where the camera turns on the spot no image tells how
// large what follows is beside what came before, and the map may be bent there.  Where half of them turn by
// more than 1 degree, short ones are none: the camera turns on the spot.  Names the piece that differs most;
// nothing where steps are even, or there are fewer than 50.
std::string UnevenSteps(const ColmapModel& model);

}  // namespace cairn::reconstruct
