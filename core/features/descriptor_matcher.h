#pragma once

#include <cstdint>

#include "core/base/pooled.h"
#include "core/features/features.h"
#include "core/features/packed_descriptors.h"

namespace cairn {

struct DescriptorMatcherOptions {
  // The distance to the best over that to the second best must be less than this, as angles between
  // descriptors, in both directions when `mutual`.  REQUIRES: in (0, 1]
  double max_ratio = 0.8;
  // Largest angle between matched descriptors, radians.  REQUIRES: > 0
  double max_angle_rad = 0.7;
  // Keep only pairs that are each other's best.
  bool mutual = true;
};

// Matches of two sets of descriptors by exact search over all dot products (kernels chosen at run time, same
// results).  Ties go to the smaller index.  Ascending idx1.  Cost: size1 * size2 * values multiply-adds;
// memory O(size1 + size2).  Reading a set from main memory takes under 1 % of a pair's time: callers need not
// order pairs for the processor's caches, only to keep few descriptors packed. REQUIRES: both packed for the
// same kernel and space.
PooledVector<Match> MatchDescriptors(const PackedDescriptors& descriptors1,
                                     const PackedDescriptors& descriptors2,
                                     const DescriptorMatcherOptions& options);
// The same for sets that are matched once: packs both.
PooledVector<Match> MatchDescriptors(const DescriptorMatrix& descriptors1,
                                     const DescriptorMatrix& descriptors2, const DescriptorSpace& space,
                                     const DescriptorMatcherOptions& options);

// The two largest dot products of one descriptor about the space's offset: what the kernels compute.  -1
// where there are fewer; of other spaces than SIFT's those of 0 and less do not count.
struct BestTwo {
  int32_t idx = -1;  // of the best, the smallest if several are
  int32_t best = -1;
  int32_t second = -1;

  // Of equal ones the first that is offered stays the best.
  void Offer(int32_t offered, int32_t dot) {
    if (dot > best) {
      second = best;
      best = dot;
      idx = offered;
    } else if (dot > second) {
      second = dot;
    }
  }
};
// Of the best two of 2 for every descriptor of 1 (rows) and of 1 for every one of 2 (columns), those that
// pass.
PooledVector<Match> SelectMatches(const PooledVector<BestTwo>& rows, const PooledVector<BestTwo>& columns,
                                  const DescriptorSpace& space, const DescriptorMatcherOptions& options);
// Best two of 2 for every descriptor of 1 (rows), and best two of 1 for every one of 2 (columns), in one
// sweep.  REQUIRES: both packed for the same kernel and space.
void FindBestTwo(const PackedDescriptors& descriptors1, const PackedDescriptors& descriptors2,
                 PooledVector<BestTwo>* rows, PooledVector<BestTwo>* columns);
void FindBestTwo(const DescriptorMatrix& descriptors1, const DescriptorMatrix& descriptors2,
                 const DescriptorSpace& space, MatchKernel kernel, PooledVector<BestTwo>* rows,
                 PooledVector<BestTwo>* columns);

}  // namespace cairn
