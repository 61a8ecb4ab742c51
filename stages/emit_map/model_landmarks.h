#pragma once

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"
#include "core/world/visual_map.h"
#include "stages/emit_map/emit_map.h"

namespace cairn::emit_map {

// Makes the visual map [Sala06 §VI-C]: for every landmark of `rows` and every heading, the sights of a model,
// the kernel that predicts left-out sights best, and its accuracy.  It uses poses on the floor and keypoints,
// but neither 3-D points nor the calibration.  Headings are the survey's own where there are at most 16 (5
// degrees apart or more), else every 45 degrees; sights between headings are turned to the nearest one by the
// focal length learnt from the survey (LearnFocal), and sights by other cameras than the most frequent one
// are left out.  Where a landmark has more sights than are stored, those far from each other are kept.  Pure;
// same result for any number of threads.  Errors: NoData (no image), Unsupported (images too
// large: RoundAsStored).
Result<VisualMapData> ModelLandmarks(const Classes& classes, const MapRows& rows,
                                     const EmitMapOptions& options, int num_threads);

}  // namespace cairn::emit_map
