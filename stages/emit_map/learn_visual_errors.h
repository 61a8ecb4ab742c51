#pragma once

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"
#include "core/world/visual_map.h"

namespace cairn::emit_map {

// Measures how accurate a visual map is [cross-validation, as of the models themselves, but over places]:
// images of the survey are localized with models that lack all sights from within 1.05 spacings around, and
// single landmarks are predicted with them too.  Shared errors are chosen so that, together with the
// landmarks' own errors, nine of ten images lie within the bound of a normal distribution; images with a flag
// do not count.  Where fewer than eight images can be tried, half a spacing and 5 degrees are assumed.  The
// tilt of data.errors is kept.  Pure; same result for any number of threads.  Errors: Corrupt (no stations).
Result<VisualErrors> LearnVisualErrors(const Classes& classes, const MapRows& rows, const VisualMapData& data,
                                       int num_threads);

}  // namespace cairn::emit_map
