#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "core/promise/expected_matches.h"
#include "core/promise/landmark_sights.h"
#include "core/world/feature_class.h"

namespace cairn {

struct LandmarkOrderOptions {
  // As many matches as a robot needs to be localized for certain.  REQUIRES: > 0
  double enough_matches = 20;
  // Positions in classes.classes that come first, in this order: a map has these already.  REQUIRES: each of
  // the pool, once
  std::vector<size_t> first = {};
  KeypointErrors keypoints;
  // Sights of the first of the pool that are computed once and kept, 56 bytes each; the others whenever they
  // are wanted.  The same order.
  size_t max_num_kept_sights = size_t{1} << 24;
};

// Orders classes so that, for any n, the first n of them serve robots in the survey's views best: a small map
// keeps these.  Adds the one next that adds most to
//
//   sum over views v of  e (1 - exp(-m_v / e)) - log tr C_v,      e = enough_matches
//
// m_v = sum of the probabilities that the chosen ones are matched; C_v = covariance of the camera's place
// by these matches (pose_information.h).  The first term is what it takes to be localized at all: each
// further match counts less, so that no view is left with few while others have many.  The second is how
// well: it goes on counting where there are enough, and prefers landmarks that are near, small, well
// triangulated and seen in many directions.
//
// Ties: the smaller position.  Same result for any number of threads.  The first term is submodular, the
// second nearly: an earlier gain is taken for a bound, so that now and then a gain that grew is overlooked.
class LandmarkOrder {
 public:
  // `pool`: positions in classes.classes, ascending; they are ordered.  `classes` must outlive it.
  LandmarkOrder(const Classes& classes, ExpectedMatches matches, std::vector<size_t> pool,
                const LandmarkOrderOptions& options, int num_threads);
  ~LandmarkOrder();
  LandmarkOrder(LandmarkOrder&&) noexcept;
  LandmarkOrder& operator=(LandmarkOrder&&) noexcept;

  // The first n, or all if there are fewer.  What was ordered before is not ordered again, so asking for few
  // costs little.
  std::vector<size_t> First(size_t n);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn
