#pragma once

#include <map>

#include "core/base/pooled.h"
#include "core/blocks/map_rows.h"
#include "core/colmap/colmap_model.h"
#include "core/world/feature_class.h"

namespace cairn::pipeline {

// The colour of exported points: maps and classes hold none (colmap color_extractor finds it).
inline constexpr std::array<uint8_t, 3> kExportColor = {128, 128, 128};

// A map as a COLMAP model: its cameras, its survey images in their refined poses, its landmarks as points
// (point_id = landmark_idx + 1).  A map stores which image sees which landmark, not where: keypoints are the
// landmarks' projections, and reprojection errors are unknown (-1).  Landmarks that project behind an image
// are not in its tracks.
ColmapModel ModelFromMap(const MapRows& rows);

// The keypoints of each image, by image_id, as in a features database.
using ImageKeypoints = std::map<ImageId, PooledVector<Keypoint>>;

// A survey's feature classes as a COLMAP model with full tracks: point_id = class_id + 1, keypoints as
// observed.  With `keypoints` every keypoint of an image is in the model and its index is the database's;
// without, only those that some class has.  Errors: Corrupt for an observation of an image or keypoint that
// is not there.
Result<ColmapModel> ModelFromClasses(const Classes& classes, const ImageKeypoints* keypoints);

}  // namespace cairn::pipeline
