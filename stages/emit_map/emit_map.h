#pragma once

#include <cstdint>
#include <string>

#include "core/decomposition.h"
#include "core/error.h"
#include "core/feature_class.h"
#include "core/map_rows.h"
#include "core/options.h"
#include "core/vocabulary_tree.h"
#include "core/world.h"

namespace cairn {

// Puts together what a robot needs to localize: the landmarks that the regions keep, which region and which
// survey image has which of them, and the visual words that lead from a view to survey images.  Before:
// group_classes, filter_visibility, decompose_regions, build_vocabulary.  After: check_map. A landmark is a
// feature class that some region keeps ([Sala06 §III]); option "all" keeps every class as a landmark while
// the regions stay as they are: the map to compare with.
struct EmitMapOptions {
  // "regions": the classes that regions keep; "all": every class.
  std::string landmarks = "regions";
};
OptionTable DescribeOptions(EmitMapOptions* options);

// Landmarks are ordered by the first region that has them (of no region: last), then by the first image that
// sees them, then by class: a region's landmarks lie together.  Images of the vocabulary without a pose are
// left out of its inverted files.  The result has no name, seed, options or hashes: those are the caller's.
// Pure.  O(observations).
// Errors: InvalidArgument (inputs that do not belong together: a region's feature, a feature's class or a
// station's image does not exist), NoData (no class is kept).
Result<MapRows> EmitMap(const Classes& classes, const World& world, const Decomposition& decomposition,
                        const Vocabulary& vocabulary, const EmitMapOptions& options);

}  // namespace cairn
