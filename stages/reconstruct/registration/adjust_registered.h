#pragma once

#include <vector>

#include "core/base/progress.h"
#include "stages/reconstruct/globally/map_globally.h"
#include "stages/reconstruct/registration/posed_input.h"

namespace cairn::reconstruct {

// Adjusts the poses of images, and their cameras, so that they fit what they see together with each other and
// with images that are held; from coarse to fine, with tracks made and triangulated anew.  `is_held`: per
// image of the input.  Cameras of held images stay.  Returns what is seen in the end.
SeenPoints AdjustRegistered(const std::vector<bool>& is_held, const MapGloballyOptions& options,
                            int num_threads, PosedInput* posed, Progress& progress);

}  // namespace cairn::reconstruct
