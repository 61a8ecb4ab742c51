#pragma once

#include "core/base/content_hash.h"
#include "core/base/pooled.h"
#include "core/features/features.h"

namespace cairn {

ContentHash HashFeatures(const PooledVector<Keypoint>& keypoints, const DescriptorMatrix& descriptors);

}  // namespace cairn
