#pragma once

#include <optional>
#include <vector>

#include "stages/reconstruct/view_graph/image_motion.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// Images of a session that show what another of it shows, from where it does: of a robot that waits, of a
// camera on a table.  They say nothing new, and all their keypoints are off as those of the first are; taken
// for measurements of their own, thirty of them outvote what the other sessions say of the place.
struct StandingImagesOptions {
  // Nine of ten matched keypoints moved by at most this, as a part of the image's longer side [3 px of 640;
  // pictures by hand, 0.13 s apart, by more than 5 px].  REQUIRES: >= 0
  double max_shift_ratio = 0.005;
  // So many of the keypoints of the image that has fewer are matched, or too much else changed.
  // REQUIRES: in [0, 1]
  double min_matched_ratio = 0.2;
};

// Which image another repeats.
struct RepeatedImage {
  int image = -1;  // index into the input's images
  double shift_px = 0;
};

// Per image of `input`: what it repeats of `images`, which are those of one session in their order; an image
// that repeats is repeated by none.
std::vector<std::optional<RepeatedImage>> FindStandingImages(const MapperInput& input,
                                                             const std::vector<int>& images,
                                                             const StandingImagesOptions& options = {});

// Motions from and to images that repeat others are those of the ones that they repeat.
std::vector<ImageMotion> MotionsOfRepeated(const std::vector<ImageMotion>& motions,
                                           const std::vector<std::optional<RepeatedImage>>& repeated);

}  // namespace cairn::reconstruct
