#pragma once

#include <map>
#include <string>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "core/colmap/colmap_model.h"
#include "core/geometry/similarity.h"
#include "stages/reconstruct/reconstruct.h"

namespace cairn::reconstruct {

// The poses of a model, cam_from_model by image name.
using ModelPoses = std::map<std::string, Pose>;

// Where scale and axes of a model come from, and what they are: world_from_model.  All sources that are there
// are asked (scale_sources.h), most trusted first:
//   control_points, odometry, imu, gps, rig, camera_height, distances.
// By scale_from = "auto" the first of them that says something is taken, unless a later one knows the scale
// three times as well (as after pictures of a garden whose GPS errs by metres); control points never give
// way. The scale's standard deviation is the taken one's.  Each two that contradict each other, by more than
// three standard deviations, are a warning.  An IMU says where up is, too, for all that do not know it better
// (all but odometry and camera_height), and where nothing gives a scale.  Fills frame, residuals, scales and
// warnings of the result. Errors: NoData (what is asked for is not there, or does not determine it); those of
// the files, of sources that are not taken too.
Result<Similarity> FindFrame(const ColmapModel& reconstruction, const Capture& capture,
                             const ReconstructOptions& options, ReconstructResult* result);

}  // namespace cairn::reconstruct
