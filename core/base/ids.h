#pragma once

#include <cstdint>
#include <limits>

namespace cairn {

// `*_id`: opaque, from a database.  `*_idx`: contiguous from 0.
using CameraId = uint32_t;
using ImageId = uint32_t;      // COLMAP's image_id: 1 .. 2^31 - 2
using ClassId = uint32_t;      // feature class = one scene feature
using KeypointIdx = uint32_t;  // index of a keypoint in its image
using StationIdx = int32_t;
using FeatureIdx = int32_t;  // feature of a world instance
using RegionIdx = int32_t;
using LandmarkIdx = int32_t;  // landmark of a map
using NodeIdx = int32_t;      // node of an appearance graph: an image, or several taken at one place

inline constexpr ImageId kInvalidImageId = std::numeric_limits<ImageId>::max();
inline constexpr ClassId kInvalidClassId = std::numeric_limits<ClassId>::max();

}  // namespace cairn
