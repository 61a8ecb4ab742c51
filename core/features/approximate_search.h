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
  // Of fewer the exact search looks at all in less time; and FLANN's queues, which are as long as what was
  // searched before on the thread, are long enough for any that is not smaller.
  static constexpr int kMinNumDescriptors = 20000;

  // REQUIRES: descriptors of the space's number of values; at least kMinNumDescriptors
  ApproximateIndex(DescriptorMatrix descriptors, const DescriptorSpace& space);
  ApproximateIndex(ApproximateIndex&&) noexcept;
  ApproximateIndex& operator=(ApproximateIndex&&) noexcept;
  ~ApproximateIndex();

  // Of those that it offers the best two for each query, as the exact search has them of all; none where it
  // offers fewer than two, as a best one without a second would pass for clear.
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
