#pragma once

#include <cstdint>

#include "core/features/features.h"

namespace cairn {

// Index of the row of `centres` (as many bytes each as the descriptor) with the largest dot product with it,
// ties to the smaller.  Uses wider instructions where the processor has them, with the same
// result.  REQUIRES: >= 1 row
int NearestCentre(const uint8_t* centres, int num_centres, const uint8_t* descriptor,
                  const DescriptorSpace& space = {});

// sums[d] += descriptor[d].
void AddDescriptor(const uint8_t* descriptor, int num_values, int32_t* sums);

// nearest[i] = min(nearest[i], squared distance of row i of `descriptors` from `centre`).
void LowerSquaredDistances(const uint8_t* descriptors, int64_t num_descriptors, const uint8_t* centre,
                           int num_values, int32_t* nearest);

}  // namespace cairn
