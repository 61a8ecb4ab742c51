#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/features/descriptor_matcher.h"
#include "core/options/options.h"
#include "stages/match_features/pairs/image_features.h"
#include "stages/match_features/pairs/select_pairs.h"
#include "stages/match_features/two_views/verify_pair.h"

namespace cairn::match_features {

struct MatchPairsOptions {
  // Largest memory that the features of images may take at a time, MiB: features beyond it are read again
  // when they are needed.  Two images are always held.  REQUIRES: >= 1
  int memory_budget_mib = 512;
  DescriptorMatcherOptions matcher;  // has the defaults of max_ratio and max_angle_rad
  // "exact": each descriptor is compared with all of the other image.  "approximate": with those that FLANN
  // offers (core/features/approximate_search.h), which misses some matches; between images of 20,000 features
  // and more.  "auto": that where it is faster, between images of some 600,000.
  std::string search = "auto";
  VerifyPairOptions verification;
};
// Without memory_budget_mib, which changes no result, like the number of threads.
OptionTable DescribeOptions(MatchPairsOptions* options);

// Pairs in the order in which they are matched: along a Z-order curve through the (idx1, idx2) square [Morton
// 1966].  Any stretch of the curve contains few images, whatever its length, so one order serves
// every budget.
void SortAlongCurve(IndexPairs* pairs);

// Stretches of `pairs` whose images take at most `max_num_bytes`: the end of each, ascending, the last is
// pairs.size().  A stretch holds at least one pair.  `num_bytes`: what each image takes.
std::vector<int64_t> CutIntoStretches(const IndexPairs& pairs, const std::vector<int64_t>& num_bytes,
                                      int64_t max_num_bytes);

// Takes a pair's verified geometry (no inliers: not verified) and its number of putative matches.
using TakeGeometry = std::function<void(const TwoViewGeometry& geometry, int num_putative)>;

// Matches and verifies `pairs` (indices into images.images; sorted along the curve here) and hands each
// result to `take`, in the curve's order and on the calling thread.  The features of one stretch of the curve
// are in memory while a second thread reads those of the next: together within the budget.  Same calls for
// any budget and number of threads.  Cost: pairs * features^2 * values multiply-adds.  Memory: the budget,
// and 8 bytes per pair.  Errors: Corrupt, Cancelled; throws SQLite::Exception as the readers do.
Status MatchPairs(SQLite::Database& database, const MatchImages& images, IndexPairs pairs,
                  const MatchPairsOptions& options, int num_threads, Progress& progress,
                  const TakeGeometry& take);

}  // namespace cairn::match_features
