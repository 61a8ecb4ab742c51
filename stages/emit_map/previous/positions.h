#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "core/base/ids.h"
#include "core/world/feature_class.h"

namespace cairn::emit_map {

// The position of the image with this id, by which they ascend; -1: there is none.
template <class Image>
int32_t PositionOf(const std::vector<Image>& images, ImageId image_id) {
  const auto found = std::lower_bound(images.begin(), images.end(), image_id,
                                      [](const Image& image, ImageId id) { return image.image_id < id; });
  if (found == images.end() || found->image_id != image_id) return -1;
  return static_cast<int32_t>(found - images.begin());
}

// Position in classes.classes by class id.
inline std::unordered_map<ClassId, size_t> IndexClasses(const Classes& classes) {
  std::unordered_map<ClassId, size_t> index;
  for (size_t i = 0; i < classes.classes.size(); ++i) index[classes.classes[i].class_id] = i;
  return index;
}

}  // namespace cairn::emit_map
