#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/base/ids.h"
#include "core/world/appearance.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/previous/positions.h"

namespace cairn::emit_map {

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
