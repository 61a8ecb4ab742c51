#pragma once

#include <vector>

#include "stages/group_classes/tracks/posed_images.h"

namespace cairn::group_classes {

// A part of a survey, with what its tracks see of it: those of two images or more.
struct SubSurvey {
  PosedImages posed;
  std::vector<Track> tracks;
};

// `images`: indices into all.stated, ascending.  The offset is kept; ways between them add up.
PosedImages SelectImages(const PosedImages& all, const std::vector<int>& images);

// `images`: indices into all.stated, ascending.
SubSurvey Restrict(const PosedImages& all, const std::vector<Track>& tracks, const std::vector<int>& images);

// About `num_images` from which a survey's noise and cameras can be learnt, ascending: of each camera two
// runs of successive images, or all where it has no more.
std::vector<int> ImagesToLearnFrom(const PosedImages& posed, int num_images);

}  // namespace cairn::group_classes
