#pragma once

#include <cstdint>
#include <span>

#include "core/features/features.h"

namespace cairn {

// Dot product of two descriptors as vectors about the space's offset; where they are at right angles or more
// (dot products of 0 and less), 0.
int32_t DescriptorDot(const uint8_t* a, const uint8_t* b, const DescriptorSpace& space = {});

// Of one descriptor with several rows of a matrix, as DescriptorDot().  REQUIRES: as many dots as rows
void DescriptorDots(const uint8_t* a, const DescriptorMatrix& descriptors, std::span<const int32_t> rows,
                    const DescriptorSpace& space, int32_t* dots);

// How far two descriptors of this dot product are from each other (DescriptorMeasure): an angle, radians in
// [0, pi / 2].
double DescriptorAngleRad(int32_t dot, const DescriptorSpace& space = {});
// The dot product of two descriptors that are so far from each other.
double DotAtAngle(double angle_rad, const DescriptorSpace& space = {});
// Descriptors of a smaller dot product are farther from each other than this: most can be told so without
// their angle.
int32_t LeastDotWithin(double angle_rad, const DescriptorSpace& space = {});

// The direction of a sum of `num` descriptors, as a descriptor; that of no direction is the offset.
DescriptorRow MeanDescriptor(const Eigen::Matrix<double, 1, Eigen::Dynamic>& sum, int64_t num,
                             const DescriptorSpace& space = {});

}  // namespace cairn
