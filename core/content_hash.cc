#include "core/content_hash.h"

#include <xxhash.h>

namespace cairn {

ContentHash HashContents(std::string_view bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  return {hash.high64, hash.low64};
}

ContentHash HashFeatures(const std::vector<Keypoint>& keypoints, const DescriptorMatrix& descriptors) {
  static_assert(sizeof(Keypoint) == 4 * sizeof(float));
  return ContentHasher()
      .Hash(HashContents(
          {reinterpret_cast<const char*>(keypoints.data()), keypoints.size() * sizeof(Keypoint)}))
      .Hash(HashContents(
          {reinterpret_cast<const char*>(descriptors.data()), static_cast<size_t>(descriptors.size())}))
      .Finish();
}

ContentHasher& ContentHasher::Text(std::string_view text) {
  bytes_.UInt64(text.size());
  bytes_.Bytes(text);
  return *this;
}

ContentHasher& ContentHasher::Hash(const ContentHash& hash) { return UInt(hash.high).UInt(hash.low); }

ContentHasher& ContentHasher::UInt(uint64_t value) {
  bytes_.UInt64(value);
  return *this;
}

ContentHasher& ContentHasher::Double(double value) {
  bytes_.Float64(value);
  return *this;
}

}  // namespace cairn
