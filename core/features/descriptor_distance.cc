#include "core/features/descriptor_distance.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/features/wide_clones.h"

namespace cairn {
namespace {

constexpr double kRightAngle = std::numbers::pi / 2;
constexpr double kUnlikeDenseRad = 0.75;

CAIRN_WIDE_CLONES int32_t SiftDot(const uint8_t* a, const uint8_t* b) {
  int32_t dot = 0;
  for (int d = 0; d < kSiftDescriptorDim; ++d) dot += static_cast<int32_t>(a[d]) * b[d];
  return dot;
}

CAIRN_WIDE_CLONES void SiftDots(const uint8_t* a, const uint8_t* all, const int32_t* rows, size_t num_rows,
                                int32_t* dots) {
  int16_t wide[kSiftDescriptorDim];
  for (int d = 0; d < kSiftDescriptorDim; ++d) wide[d] = a[d];
  for (size_t k = 0; k < num_rows; ++k) {
    const uint8_t* b = all + static_cast<int64_t>(rows[k]) * kSiftDescriptorDim;
    int32_t dot = 0;
    for (int d = 0; d < kSiftDescriptorDim; ++d) dot += wide[d] * static_cast<int16_t>(b[d]);
    dots[k] = dot;
  }
}

CAIRN_WIDE_CLONES int32_t CentredDot(const uint8_t* a, const uint8_t* b, int num_values, int offset) {
  int32_t dot = 0;
  for (int d = 0; d < num_values; ++d)
    dot += (static_cast<int32_t>(a[d]) - offset) * (static_cast<int32_t>(b[d]) - offset);
  return std::max(dot, 0);
}

}  // namespace

int32_t DescriptorDot(const uint8_t* a, const uint8_t* b, const DescriptorSpace& space) {
  if (space.is_sift()) return SiftDot(a, b);
  return CentredDot(a, b, space.num_values, space.offset);
}

void DescriptorDots(const uint8_t* a, const DescriptorMatrix& descriptors, std::span<const int32_t> rows,
                    const DescriptorSpace& space, int32_t* dots) {
  if (space.is_sift()) return SiftDots(a, descriptors.data(), rows.data(), rows.size(), dots);
  for (size_t k = 0; k < rows.size(); ++k)
    dots[k] = CentredDot(a, descriptors.row(rows[k]).data(), space.num_values, space.offset);
}

double DescriptorAngleRad(int32_t dot, const DescriptorSpace& space) {
  const double cosine = std::clamp(dot / space.squared_norm, 0.0, 1.0);
  switch (space.measure) {
    case DescriptorMeasure::kAngle:
      return std::acos(cosine);
    case DescriptorMeasure::kHamming:
      return kRightAngle * (1 - cosine);
    case DescriptorMeasure::kDense: {
      const double ratio = std::acos(cosine) / kUnlikeDenseRad;
      return std::min(kRightAngle, kRightAngle * ratio * ratio * ratio * ratio);
    }
  }
  return 0;
}

double DotAtAngle(double angle_rad, const DescriptorSpace& space) {
  switch (space.measure) {
    case DescriptorMeasure::kAngle:
      return space.squared_norm * std::cos(angle_rad);
    case DescriptorMeasure::kHamming:
      return space.squared_norm * (1 - angle_rad / kRightAngle);
    case DescriptorMeasure::kDense:
      return space.squared_norm * std::cos(kUnlikeDenseRad * std::sqrt(std::sqrt(angle_rad / kRightAngle)));
  }
  return 0;
}

int32_t LeastDotWithin(double angle_rad, const DescriptorSpace& space) {
  if (!(angle_rad < kRightAngle)) return 0;
  // A dot product less than what rounding may have it.
  return std::max(0, static_cast<int32_t>(std::floor(DotAtAngle(angle_rad, space))) - 1);
}

DescriptorRow MeanDescriptor(const Eigen::Matrix<double, 1, Eigen::Dynamic>& sum, int64_t num,
                             const DescriptorSpace& space) {
  Eigen::Matrix<double, 1, Eigen::Dynamic> direction =
      sum.array() - static_cast<double>(num) * static_cast<double>(space.offset);
  const double norm = direction.norm();
  if (norm > 0) direction *= std::sqrt(space.squared_norm) / norm;
  return (direction.array() + space.offset).round().cwiseMax(0.0).cwiseMin(255.0).cast<uint8_t>();
}

}  // namespace cairn
