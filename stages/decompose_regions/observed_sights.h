#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/promise/pose_information.h"
#include "core/world/feature_class.h"
#include "stages/decompose_regions/choose_features.h"

namespace cairn::decompose_regions {

// What the observations of a class, with weight p_l = `distinctiveness` in [0, 1], tell about the poses of
// the images that have them; a view is a position in Classes::images.  An image in which the class lies at
// the camera's own centre is left out.  Errors: InvalidArgument, naming an image or camera that does not
// exist.
Result<std::vector<SightInformation>> ObservedSights(const FeatureClass& feature_class,
                                                     double distinctiveness, const Classes& classes,
                                                     const ChooseFeaturesOptions& options);

}  // namespace cairn::decompose_regions
