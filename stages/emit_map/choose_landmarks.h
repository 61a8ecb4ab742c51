#pragma once

#include <cstddef>
#include <vector>

#include "core/world/feature_class.h"

namespace cairn::emit_map {

// Orders classes so that, for any n, the first n of them serve the survey's images best: what a map of few
// bytes keeps.  Maximises
//
//   sum over images of  1 - exp(-m / enough),   m = sum of the repeatability of the kept classes it sees
//
// greedily.  m is the number of landmarks that a robot standing there can expect to match; 1 - exp stands for
// how likely it is localized by them: each more counts less, so that no image is left with few while others
// have plenty.  The sum is monotone and submodular, so the first n reach at least 1 - 1/e of what any n
// classes do [Nemhauser, Wolsey, Fisher, "An analysis of approximations for maximizing submodular set
// functions", 1978]. Repeatability of a class: the part of the images that look at its place from about where
// it was seen which do see it.
//
// `pool`: positions in classes.classes, ascending; the result has each once.  Ties: the class with more
// observations, then the smaller position.  Same result for any number of threads.
// O(pool * images + observations * log(pool)).  REQUIRES: enough > 0
std::vector<size_t> OrderByUse(const Classes& classes, const std::vector<size_t>& pool, double enough,
                               int num_threads);

}  // namespace cairn::emit_map
