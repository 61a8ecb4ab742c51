#pragma once

#include <cstddef>
#include <vector>

#include "core/world/feature_class.h"

namespace cairn::emit_map {

// Orders classes so that, for any n, the first n of them serve the survey's images best: a small map keeps
// these.  Maximises
//
//   sum over images of  1 - exp(-m / enough),   m = sum of the repeatability of the kept classes it sees
//
// greedily.  m is the number of landmarks that a robot standing there can expect to match; 1 - exp models the
// probability that it is localized by them: each further landmark counts less, so that no image is left with
// few while others have many.  The sum is monotone and submodular, so the first n reach at least 1 - 1/e of
// the value of any n classes [Nemhauser, Wolsey, Fisher, "An analysis of approximations for maximizing
// submodular set functions", 1978].  Repeatability of a class: of the images that look at its place from
// about where it was seen, the part that sees it.
//
// `pool`: positions in classes.classes, ascending; the result has each once.  Ties: the class with more
// observations, then the smaller position.  Same result for any number of threads.
// O(pool * images + observations * log(pool)).  REQUIRES: enough > 0
std::vector<size_t> OrderByUse(const Classes& classes, const std::vector<size_t>& pool, double enough,
                               int num_threads);

}  // namespace cairn::emit_map
