#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/base/ids.h"
#include "core/world/appearance.h"
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

// Which images a map lists.  A place that is surveyed again and again has ever more images, of the same
// views: those of today (core/promise/later_views.h) stand for them.  So do those that prove a change, and
// with `all_images` all of them do.
struct ImagesOfMap {
  std::vector<int32_t> listed;  // positions in Classes::images, ascending
  // Per image: the index in `listed` of itself, or of the image that shows its view.
  std::vector<int32_t> row_of_image;

  bool ListsAll() const { return listed.size() == row_of_image.size(); }
  bool Lists(size_t image) const { return listed[row_of_image[image]] == static_cast<int32_t>(image); }
};
ImagesOfMap ChooseImages(const Classes& classes, bool all_images);

// The graph of the listed images.  A node none of whose images is listed becomes one with the node that shows
// its first image's view: kept where either is, linked to all that either is linked to.
Appearance OfListedImages(const Appearance& appearance, const Classes& classes, const ImagesOfMap& images);

}  // namespace cairn::emit_map
