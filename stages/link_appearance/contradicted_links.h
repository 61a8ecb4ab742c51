#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/world/feature_class.h"
#include "stages/link_appearance/fuse_images.h"

namespace cairn::link_appearance {

// Links that contradict where their images stand: the matches are of places that look alike.  Two doors, or
// two wings of one plan, match as well as two views of one door do, and a geometry of two views explains
// them; but the points that other images place at one door do not project to where the other image shows
// them.
//
// Per link, 1 where fewer than half of its matches agree.  A match counts where one of its keypoints is of a
// feature class: the class's position, projected into the other image, lies within 2 % of that image's larger
// side of the other keypoint; both ways where both are.  Links with fewer than five such matches, and such of
// images without a pose, are taken for what they are.  Needs no scale: distances are in pixels.
//
// `matches_path`: matches.db, for keypoints and matches; pairs by pairs, and keypoints of some thousand
// images at a time.  Errors: those of OpenColmapDatabase; InvalidArgument (classes of other matches).
Result<std::vector<char>> FindContradictedLinks(const ImageLinks& images, const Classes& classes,
                                                const std::string& matches_path, Progress* progress);

// Makes these links of `images` look-alikes.
Status TellLookAlikes(const Classes& classes, const std::string& matches_path, Progress* progress,
                      ImageLinks* images);

}  // namespace cairn::link_appearance
