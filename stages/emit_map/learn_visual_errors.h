#pragma once

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"
#include "core/world/visual_map.h"

namespace cairn::emit_map {

// Finds out how much to trust a visual map [cross-validation, as of the models themselves, but over places]:
// images of the survey are placed by models that lack all sights from within 1.05 spacings around, and so are
// single landmarks predicted.  Shared errors are such that nine of ten images lie as a normal distribution
// says, beside what the landmarks' own errors explain; those with a flag do not count.  Where fewer than
// eight images can be tried nothing is known, and half a spacing and 5 degrees are taken.  data.errors' tilt
// stays. Pure; same result for any number of threads.  Errors: Corrupt (no stations).
Result<VisualErrors> LearnVisualErrors(const Classes& classes, const MapRows& rows, const VisualMapData& data,
                                       int num_threads);

}  // namespace cairn::emit_map
