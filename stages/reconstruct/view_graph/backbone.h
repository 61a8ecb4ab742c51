#pragma once

#include <vector>

#include "stages/reconstruct/view_graph/image_motion.h"
#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {

// Whether the images are a drive, in the order of their names: most show much of what the next one shows, or
// odometry says how the next one was reached.
bool IsDrive(int num_images, const std::vector<ViewPair>& pairs, const std::vector<ImageMotion>& motions);

// Sets the pairs' weights: their strengths, less where they have few matches; of a drive, over how many
// images they are apart, up to ten.
void SetWeights(bool is_drive, std::vector<ViewPair>* pairs);

// The pairs to begin with.  Of images in no order those that are trusted: that show most of the same,
// relative to the most that one of the two shares with any image, and that triangles bear out; and as few
// weaker ones as join all images that no motion joins, if they are not too weak.  Of a drive only near ones
// in its order, and others only where those do not join it.  Rooms that share a panel or a door look alike in
// a part of the image: such pairs are weaker than those of one place, but agree with each other, and would
// bend the map before it is made; it tells them once it is there [after Cui & Tan 2015 and Heinly et al.
// 2014, who filter by cycles and by what is missing].  Indices of pairs, ascending.
std::vector<int> Backbone(int num_images, const std::vector<ViewPair>& pairs,
                          const std::vector<ImageMotion>& motions, bool is_drive);

}  // namespace cairn::reconstruct
