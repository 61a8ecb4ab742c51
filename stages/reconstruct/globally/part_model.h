#pragma once

#include <vector>

#include "core/colmap/colmap_model.h"
#include "core/structure/triangulate.h"
#include "core/structure/union_matches.h"
#include "stages/reconstruct/globally/adjust_model.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// What was found of some images as a model: poses and cameras of `problem`, points of the tracks' inliers.
// `images`: indices into the input's, to which those of the others refer.  Images that see fewer than 15
// points are not in it, nor are points that fewer than two of the others see.
ColmapModel ModelOfPart(const MapperInput& input, const std::vector<int>& images, const ModelProblem& problem,
                        const std::vector<Track>& tracks, const std::vector<Triangulation>& triangulations);

}  // namespace cairn::reconstruct
