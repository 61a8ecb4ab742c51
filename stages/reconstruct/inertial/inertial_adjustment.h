#pragma once

#include "stages/reconstruct/inertial/inertial_alignment.h"
#include "stages/reconstruct/inertial/inertial_start.h"

namespace cairn::reconstruct {

// The second part of AlignToImu: all unknowns at once, and how well the scale is known.  `is_turn_stated`:
// then the start's turn is as good as options.stated_turn_sigma_deg, and its place as stated_place_sigma_m;
// else only the turns of the images say so.  REQUIRES: start.scale > 0
InertialAlignment AdjustInertial(const InertialStart& start, bool is_turn_stated,
                                 const InertialOptions& options);

}  // namespace cairn::reconstruct
