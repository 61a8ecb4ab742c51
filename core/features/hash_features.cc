#include "core/features/hash_features.h"

namespace cairn {

ContentHash HashFeatures(const PooledVector<Keypoint>& keypoints, const DescriptorMatrix& descriptors) {
  static_assert(sizeof(Keypoint) == 4 * sizeof(float));
  return ContentHasher()
      .Hash(HashContents(
          {reinterpret_cast<const char*>(keypoints.data()), keypoints.size() * sizeof(Keypoint)}))
      .Hash(HashContents(
          {reinterpret_cast<const char*>(descriptors.data()), static_cast<size_t>(descriptors.size())}))
      .Finish();
}

}  // namespace cairn
