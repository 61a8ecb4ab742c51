#pragma once

#include <vector>

#include "core/base/content_hash.h"
#include "core/features/features.h"

namespace cairn {

ContentHash HashFeatures(const std::vector<Keypoint>& keypoints, const DescriptorMatrix& descriptors);

}  // namespace cairn
