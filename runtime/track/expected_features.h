#pragma once

#include <span>

#include "runtime/localize/localizer.h"
#include "runtime/map/map.h"
#include "runtime/track/region_tracker.h"

namespace cairn {

// Localizes an image among landmarks (ascending) that a prior expects in it, by features of the scales and in
// the places of the landmarks.  The coarse ones, which the whole image is searched for, are accepted or
// refused as all features of an image would be, by what those of their scales show; fine ones make the fix
// more exact.  No fix where half of the landmarks' sizes are not known.  Errors: as Localizer::Localize.
// REQUIRES: frame.image()
Result<Localization> LocalizeExpected(const Map& map, const Localizer& localizer, const QueryFrame& frame,
                                      std::span<const LandmarkIdx> expected, const PosePrior& prior,
                                      const ExpectedFeaturesOptions& options);

}  // namespace cairn
