#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/visual_map/visual_map.h"

namespace cairn {

// What [Sala06 §VI-C] measures of p(x | z) over the survey's places.  Whose it is: PosteriorOnLattice of
// runtime/visual_map/visual_estimate.h.

// The source's estimate, argmax of p(x | z) [Sala06 §VI-C].  Of equally likely places (within 1e-9 of the
// largest) the one nearest to their middle; of equally near ones the first.  REQUIRES: a number per place
int32_t LikeliestPlace(const VisualMap& map, std::span<const double> at_place);

// Kullback-Leibler divergence of p from q, sum of p log(p / q) in nats, after mixing `uniform_weight` of the
// uniform distribution into both [Sala06 §VI-C].  Not symmetric: the source has p from a decomposition's map,
// q from the one of all features.  Infinite where q is 0 and p is not, which needs uniform_weight = 0.
// REQUIRES: both have the same size; uniform_weight in [0, 1]
double KlDivergence(std::span<const double> p, std::span<const double> q, double uniform_weight);

}  // namespace cairn
