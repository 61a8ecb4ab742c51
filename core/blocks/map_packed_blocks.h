#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/base/blob.h"
#include "core/blocks/map_blocks.h"

namespace cairn {

// The parts of packed blocks that are range coded (core/base/range_coder.h): schemas/FORMAT.md draws them.
// What was decoded encodes to the same bytes.

// Landmarks without their regions.  REQUIRES: block.descriptor_code; the descriptors' own levels stand for
// them (QuantizeByTransform), else they take 128 bytes each
std::string PackLandmarks(const LandmarkBlock& block);
// Fills in `block`, whose landmarks have their number.  False where the bytes make no sense.
bool UnpackLandmarks(std::string_view bytes, LandmarkBlock* block);

// The lists of landmarks that images see.  REQUIRES: strictly ascending numbers >= 0
std::string PackSights(const std::vector<MapImage>& images);
// Fills in the landmarks of images.  False where the bytes make no sense, name landmarks from `max_num_landmarks` on, or
// give an image more than kMaxImageLandmarks.
bool UnpackSights(std::string_view bytes, int64_t max_num_landmarks, std::vector<MapImage>* images);

}  // namespace cairn
