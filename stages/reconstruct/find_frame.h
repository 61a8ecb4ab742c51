#pragma once

#include <map>
#include <string>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "core/geometry/similarity.h"
#include "stages/reconstruct/reconstruct.h"

namespace cairn::reconstruct {

// The poses of a model, cam_from_model by image name.
using ModelPoses = std::map<std::string, Pose>;

// Where scale and axes of a model come from, and what they are (options.scale_from): world_from_model.  Fills
// frame, residuals, scale_sigma_ratio and warnings of the result; where two sources know the scale, it says
// whether they agree.  Errors: NoData (what is asked for is not there, or does not determine it); those of
// the files.
Result<Similarity> FindFrame(const ModelPoses& model, const Capture& capture,
                             const ReconstructOptions& options, ReconstructResult* result);

}  // namespace cairn::reconstruct
