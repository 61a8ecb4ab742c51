#pragma once

#include <cstdint>

#include "core/features/features.h"

namespace cairn {

// Dot product of two descriptors as vectors about the space's offset; where they are at right angles or more
// (dot products of 0 and less), 0.
int32_t DescriptorDot(const uint8_t* a, const uint8_t* b, const DescriptorSpace& space = {});

// How far two descriptors of this dot product are from each other (DescriptorMeasure): an angle, radians in
// [0, pi / 2].
double DescriptorAngleRad(int32_t dot, const DescriptorSpace& space = {});
// The dot product of two descriptors that are so far from each other.
double DotAtAngle(double angle_rad, const DescriptorSpace& space = {});

// The direction of a sum of `num` descriptors, as a descriptor; that of no direction is the offset.
DescriptorRow MeanDescriptor(const Eigen::Matrix<double, 1, Eigen::Dynamic>& sum, int64_t num,
                             const DescriptorSpace& space = {});

}  // namespace cairn
