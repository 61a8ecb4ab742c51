#pragma once

#include <memory>
#include <vector>

#include "core/atlas/atlas_file.h"
#include "core/base/error.h"
#include "core/base/progress.h"
#include "runtime/atlas/code_index.h"
#include "runtime/map/map.h"

namespace cairn::pipeline {

// Which survey images of each map have a fix in another one: what their maps know of them, their landmarks,
// is localized there.  `num_images`: of each map at most so many, evenly spread; `maps`: the atlas's.
// Same maps, same answer, for any number of threads.  Errors: as Localizer::LocalizeFeatures; Cancelled.
Result<std::vector<AtlasLookAlike>> FindLookAlikes(const AtlasRows& atlas,
                                                   const std::vector<std::shared_ptr<const Map>>& maps,
                                                   int num_images, int num_threads, Progress* progress);

}  // namespace cairn::pipeline
