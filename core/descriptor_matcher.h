#pragma once

#include <cstdint>
#include <vector>

#include "core/features.h"

namespace cairn {

struct DescriptorMatcherOptions {
  // A match's distance to its best over its second best must be at most this, as angles between RootSIFT
  // vectors, in both directions when `mutual`.  REQUIRES: in (0, 1]
  double max_ratio = 0.8;
  // Largest angle between matched descriptors, radians.  REQUIRES: > 0
  double max_angle_rad = 0.7;
  // Keep only pairs that are each other's best.
  bool mutual = true;
};

// Instruction sets that have a kernel.
enum class MatchKernel { kPortable, kAvx2, kAvx512Vnni };
bool IsKernelSupported(MatchKernel kernel);
// The fastest one that this processor supports.
MatchKernel FastestKernel();

// The descriptors of one image in the layout of a kernel: packed once, matched with many others.  Immutable,
// may be shared between threads.
class PackedDescriptors {
 public:
  PackedDescriptors() = default;
  explicit PackedDescriptors(const DescriptorMatrix& descriptors, MatchKernel kernel = FastestKernel());

  // Number of descriptors.
  int size() const { return static_cast<int>(descriptors_.rows()); }
  MatchKernel kernel() const { return kernel_; }
  // Memory that it holds.
  int64_t num_bytes() const { return NumBytes(size()); }
  // At most what `num_descriptors` descriptors will take once packed, by any kernel: for memory budgets.
  static int64_t NumBytes(int64_t num_descriptors) { return 160 * num_descriptors + 16384; }

  const DescriptorMatrix& descriptors() const { return descriptors_; }

 private:
  MatchKernel kernel_ = MatchKernel::kPortable;
  DescriptorMatrix descriptors_;
};

// Matches of two sets of RootSIFT descriptors by exact search over all dot products (kernels chosen at run
// time, same results).  Ties go to the smaller index.  Ascending idx1.  Cost: size1 * size2 * 128
// multiply-adds; memory O(size1 + size2).  Reading a set from main memory takes under 1 % of a pair's time:
// callers need not order pairs for the sake of the caches, only for that of what they keep packed.
// REQUIRES: both packed for the same kernel.
std::vector<Match> MatchDescriptors(const PackedDescriptors& descriptors1,
                                    const PackedDescriptors& descriptors2,
                                    const DescriptorMatcherOptions& options);
// The same for sets that are matched once: packs both.
std::vector<Match> MatchDescriptors(const DescriptorMatrix& descriptors1,
                                    const DescriptorMatrix& descriptors2,
                                    const DescriptorMatcherOptions& options);

// The two largest dot products of one row: what the kernels compute.  idx -1 where there are fewer than one
// column.
struct BestTwo {
  int32_t idx = -1;
  int32_t best = -1;
  int32_t second = -1;
};
// Best two columns for every row of 1, and best two rows for every column of 2, in one sweep.
void FindBestTwo(const DescriptorMatrix& descriptors1, const DescriptorMatrix& descriptors2,
                 MatchKernel kernel, std::vector<BestTwo>* rows, std::vector<BestTwo>* columns);

}  // namespace cairn
