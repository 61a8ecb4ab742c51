#pragma once

#include <cstdint>
#include <vector>

#include "core/promise/view_distance.h"
#include "core/world/feature_class.h"

namespace cairn {

// A map is for today.  An image of an earlier session is of the past where a later session has an image
// within two views' radii: that one shows what has changed since as it is now.  Images of today are those of
// the last session, and of earlier ones where no later one was.
//
// Per image, the position of the image of today that shows its view, the nearest of those; -1: it is of today
// itself.  A survey of one session is all of today.  O(images * images of today).
std::vector<int32_t> LaterViews(const Classes& classes, const ViewDistance& distance);

// Positions of the images of today, ascending.
std::vector<int32_t> ImagesOfToday(const std::vector<int32_t>& later_views);

}  // namespace cairn
