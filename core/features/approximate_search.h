#pragma once

#include <cstdint>
#include <memory>

#include "core/base/pooled.h"
#include "core/features/descriptor_matcher.h"
#include "core/features/features.h"

namespace cairn {

// An index of one set of descriptors in which most nearest ones are found without looking at all: FLANN's
// (OpenCV's copy) forest of four k-d trees, of which 128 leaves are looked at [Muja09], as COLMAP has it; of
// binary descriptors, tables of locality-sensitive hashes [Lv07].  What it offers is compared exactly.  The
// same for the same descriptors, on any thread; may be shared between threads.
//   Muja09: Fast approximate nearest neighbors with automatic algorithm configuration.
//   Lv07: Multi-probe LSH: efficient indexing for high-dimensional similarity search.
class ApproximateIndex {
 public:
  // REQUIRES: descriptors of the space's number of values; at least one
  ApproximateIndex(DescriptorMatrix descriptors, const DescriptorSpace& space);
  ApproximateIndex(ApproximateIndex&&) noexcept;
  ApproximateIndex& operator=(ApproximateIndex&&) noexcept;
  ~ApproximateIndex();

  // Of those that it offers the best two for each query, as the exact search has them of all.
  void FindBestTwo(const DescriptorMatrix& queries, PooledVector<BestTwo>* best) const;

  const DescriptorMatrix& descriptors() const;
  const DescriptorSpace& space() const;

  // About what an index of so many descriptors takes, with these, bytes.
  static int64_t NumBytes(int64_t num_descriptors, const DescriptorSpace& space);

 private:
  class Search;
  std::unique_ptr<Search> search_;
};

// Whether two sets are so large that looking at all pairs of descriptors takes longer than searching for each
// of both: the exact search takes size1 * size2, the other about size1 + size2 (bench/matching/README.md). Of
// binary descriptors never: the hashes of as many never were faster.
bool IsApproximateFaster(int64_t size1, int64_t size2, const DescriptorSpace& space);

// As MatchDescriptors() of what the indices offer.  REQUIRES: both of the same space
PooledVector<Match> MatchApproximately(const ApproximateIndex& index1, const ApproximateIndex& index2,
                                       const DescriptorMatcherOptions& options);

}  // namespace cairn
