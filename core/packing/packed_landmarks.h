#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/features/features.h"
#include "core/features/transform_code.h"
#include "core/packing/map_landmark.h"

namespace cairn {

// Landmarks with their descriptors, range coded (range_coder.h): schemas/FORMAT.md draws the bytes and states
// the errors.  What was decoded encodes to the same bytes.
struct PackedLandmarks {
  std::vector<MapLandmark> landmarks;
  DescriptorMatrix descriptors;  // row i: landmark i
  TransformCode code;
};

// REQUIRES: as many descriptors as landmarks; those that are not what their own levels stand for
// (QuantizeByTransform) take 128 bytes each.
std::string PackLandmarks(const PackedLandmarks& packed);
// False where the bytes are not those of so many landmarks.
bool UnpackLandmarks(std::string_view bytes, size_t num_landmarks, PackedLandmarks* packed);

// The same for a reader who has others, of the code that is meant: a few landmarks take less then, as what
// they are like is known.  Of these the first so many count: what is learnt from more is no better.
inline constexpr size_t kMaxNumKnownLandmarks = 4096;
std::string PackMoreLandmarks(const PackedLandmarks& known, const PackedLandmarks& more);
bool UnpackMoreLandmarks(const PackedLandmarks& known, std::string_view bytes, size_t num_landmarks,
                         PackedLandmarks* more);

}  // namespace cairn
