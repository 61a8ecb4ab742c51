#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_findings.h"
#include "core/world/dropped_items.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"

namespace cairn::emit_map {

// Counts what the stages dropped, by reason, ascending: how much in all, and how much of it at each station.
// An item counts at a station where
//   image                it was taken there
//   pair                 one of its images was taken there
//   feature              it was seen there, as far as it had come: a track with a keypoint in an image taken
//                        there, a class with an observation in one, a feature of the world visible there
//   keypoint             its image was taken there
//   view, station        it is the station's
// and counts once there, except keypoints and views, which all count.  Items of images at no station count in
// the total only.  O(items + observations).  Errors: InvalidArgument (an item that names a class, a feature
// or a station that does not exist).
Result<std::vector<DropCount>> CountDrops(const Classes& classes, const World& world,
                                          const std::vector<DroppedItem>& items);

}  // namespace cairn::emit_map
