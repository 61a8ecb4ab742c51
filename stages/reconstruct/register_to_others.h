#pragma once

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/capture/capture.h"
#include "core/colmap/colmap_model.h"
#include "stages/reconstruct/reconstruct.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// Fills the result of Reconstruct for a capture whose sessions `capture.registered` have no poses in the
// frame of the others: these are found (registration/register_sessions.h), all others stay as they are
// stated.  One in hold_out_every images of those joined is held out, besides the capture's queries.  Sessions
// of which nothing is joined are warned of.  Returns what all images see, in the frame.  Errors: those of
// RegisterSessions and of the odometry's file.
Result<ColmapModel> RegisterToOthers(const MapperInput& input, const Capture& capture,
                                     const ReconstructOptions& options, int num_threads, Progress& progress,
                                     ReconstructResult* result);

}  // namespace cairn::reconstruct
