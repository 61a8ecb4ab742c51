#pragma once

#include <cstdint>

#include "core/features/features.h"

namespace cairn {

// Index of the row of `centres` (kDescriptorDim bytes each) with the largest dot product with a descriptor,
// ties to the smaller.  Uses wider instructions where the processor has them, with the same
// result.  REQUIRES: >= 1 row
int NearestCentre(const uint8_t* centres, int num_centres, const uint8_t* descriptor);

// sums[d] += descriptor[d].
void AddDescriptor(const uint8_t* descriptor, int32_t* sums);

// nearest[i] = min(nearest[i], squared distance of row i of `descriptors` from `centre`).
void LowerSquaredDistances(const uint8_t* descriptors, int64_t num_descriptors, const uint8_t* centre,
                           int32_t* nearest);

}  // namespace cairn
