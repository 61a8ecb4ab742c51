#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/pooled.h"
#include "core/camera/camera.h"
#include "core/colmap/colmap_database.h"

namespace cairn::reconstruct {

// What the mapper reads of matches.db: no descriptors.
struct MapperInput {
  std::map<CameraId, Camera> cameras;
  std::vector<DatabaseImage> images;              // ascending image_id
  std::vector<PooledVector<Keypoint>> keypoints;  // per image
  std::vector<TwoViewGeometry> geometries;        // pairs with at least kMinNumMatches inliers
};

// Where each image stands in `images`.
std::map<ImageId, int> IndexOf(const MapperInput& input);

// Fewest verified matches of a pair that the mapper uses (its own default).
inline constexpr int kMinNumMatches = 15;

// Errors: those of the database's readers; NoData without a verified pair.
Result<MapperInput> ReadMapperInput(const std::string& matches_path);

}  // namespace cairn::reconstruct
