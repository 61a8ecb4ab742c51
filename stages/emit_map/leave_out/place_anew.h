#pragma once

#include "core/structure/triangulate.h"
#include "core/world/feature_class.h"

namespace cairn::emit_map {

// Triangulates the classes of `rest` that have fewer observations than in `whole`, from those that are left
// and as group_classes would; those that do not triangulate are left out.  Both ascending by class id; same
// images, except those that `rest` lacks.  Same result for any number of threads.  O(observations).
void PlaceAnew(const Classes& whole, const TriangulateOptions& options, int num_threads, Classes* rest);

}  // namespace cairn::emit_map
