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

// Matches of two sets of RootSIFT descriptors by exact search over all dot products (kernels for AVX-512
// VNNI, AVX2 and portable C++, chosen at run time, same results).  Ties go to the smaller index.  Ascending
// idx1. Cost: num1 * num2 * 128 multiply-adds; memory O(num1 + num2).
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
enum class MatchKernel { kPortable, kAvx2, kAvx512Vnni };
bool IsKernelSupported(MatchKernel kernel);
// The fastest one that this processor supports.
MatchKernel FastestKernel();
// Best two columns for every row of 1, and best two rows for every column of 2, in one sweep.
void FindBestTwo(const DescriptorMatrix& descriptors1, const DescriptorMatrix& descriptors2,
                 MatchKernel kernel, std::vector<BestTwo>* rows, std::vector<BestTwo>* columns);

}  // namespace cairn
