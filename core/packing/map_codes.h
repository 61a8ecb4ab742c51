#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/base/blob.h"

namespace cairn {

// Numbers of a map as few bits; schemas/FORMAT.md draws them.  What was decoded encodes to the same code.

// Unit of stored positions: 0.1 mm, so a coordinate is off by at most 0.05 mm.
inline constexpr double kMapLengthUnitM = 1e-4;
int32_t EncodeLength(double metres);  // REQUIRES: |metres| <= 2e5
inline double DecodeLength(int64_t code) { return static_cast<double>(code) * kMapLengthUnitM; }

// A size >= 0 on a logarithmic scale, within 4.5 %: 0 is 0, code c is 1 um * 2^((c - 1) / 8), so 1 um to 3.6
// km; what lies outside becomes the nearest code.
uint8_t EncodeSize(double metres);
double DecodeSize(uint8_t code);

// A covariance matrix in 63 bits.  Row i of its Cholesky factor is its standard deviation, a size as above,
// times a unit vector given by angles of 0.02 degrees: the result is a covariance matrix whatever the bits
// are.  Standard deviations are off by at most 4.5 %, angles by 0.011 degrees.
uint64_t EncodeCovariance(const Eigen::Matrix3d& covariance);
Eigen::Matrix3d DecodeCovariance(uint64_t code);

// A rotation in 13 bytes, off by less than 1e-8 rad: which of w, x, y, z is largest, and the others as int32
// times 2^-31, signed so that the largest is positive.
void WriteRotation(const Eigen::Quaterniond& rotation, BlobWriter* writer);
Eigen::Quaterniond ReadRotation(BlobReader* reader);  // ok() is also false when the three are too long

// Most list elements that a block decodes to: bounds what a few bytes of runs allocate.
inline constexpr int64_t kMaxListElements = 1 << 22;

// Strictly ascending numbers >= 0 as runs of consecutive ones: a varint of the number of runs, then per run a
// varint of 2 * gap + (1 if it is longer than one), and then its length less 2.
void WriteRuns(const std::vector<int32_t>& values, BlobWriter* writer);
// False when a value is outside [0, limit) or there are more than `*max_num_values`; subtracts their number
// from it.
bool ReadRuns(BlobReader* reader, int64_t limit, int64_t* max_num_values, std::vector<int32_t>* values);

// Signed numbers with small magnitudes as small unsigned ones: 0, -1, 1, -2, ...
inline uint64_t ZigZag(int64_t value) {
  return (static_cast<uint64_t>(value) << 1) ^ static_cast<uint64_t>(value >> 63);
}
inline int64_t UnZigZag(uint64_t code) {
  return static_cast<int64_t>(code >> 1) ^ -static_cast<int64_t>(code & 1);
}

}  // namespace cairn
