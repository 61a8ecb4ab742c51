#include "core/features/transform_code.h"

#include <algorithm>
#include <bit>
#include <cstdlib>

namespace cairn {
namespace {

constexpr int kNumCells = 4, kNumOrientations = 8;
constexpr int kScaleBits = 12;  // of the entries below
// Rows are frequencies: DCT-II of 4 values, orthonormal.
constexpr std::array<std::array<int64_t, kNumCells>, kNumCells> kCosine = {{
    {2048, 2048, 2048, 2048},
    {2676, 1108, -1108, -2676},
    {2048, -2048, -2048, 2048},
    {1108, -2676, 2676, -1108},
}};
// 1, cos and sin of 1 to 3 periods, and 4 periods over 8 orientations, orthonormal.
constexpr std::array<std::array<int64_t, kNumOrientations>, kNumOrientations> kFourier = {{
    {1448, 1448, 1448, 1448, 1448, 1448, 1448, 1448},
    {2048, 1448, 0, -1448, -2048, -1448, 0, 1448},
    {0, 1448, 2048, 1448, 0, -1448, -2048, -1448},
    {2048, 0, -2048, 0, 2048, 0, -2048, 0},
    {0, 2048, 0, -2048, 0, 2048, 0, -2048},
    {2048, -1448, 0, 1448, -2048, 1448, 0, -1448},
    {0, 1448, -2048, 1448, 0, -1448, 2048, -1448},
    {1448, -1448, 1448, -1448, 1448, -1448, 1448, -1448},
}};

using Values = std::array<int64_t, kSiftDescriptorDim>;

// One axis of a separable transform or, transposed, of its inverse: `stride` values lie between two of it.
template <size_t kSize>
void TransformAxis(const std::array<std::array<int64_t, kSize>, kSize>& matrix, bool is_inverse,
                   size_t stride, Values* values) {
  for (size_t first = 0; first < values->size(); ++first) {
    if (first / stride % kSize != 0) continue;
    std::array<int64_t, kSize> result = {};
    for (size_t row = 0; row < kSize; ++row) {
      for (size_t col = 0; col < kSize; ++col)
        result[row] += (is_inverse ? matrix[col][row] : matrix[row][col]) * (*values)[first + col * stride];
    }
    for (size_t row = 0; row < kSize; ++row) (*values)[first + row * stride] = result[row];
  }
}

void Transform(bool is_inverse, Values* values) {
  TransformAxis(kFourier, is_inverse, 1, values);
  TransformAxis(kCosine, is_inverse, kNumOrientations, values);
  TransformAxis(kCosine, is_inverse, kNumOrientations * kNumCells, values);
}

constexpr int kAllScaleBits = 3 * kScaleBits;
constexpr int64_t kOne = int64_t{1} << kAllScaleBits;
constexpr int64_t kMaxLevel = 4096;
// A value is taken for the next level from 0.58 of the way on.
constexpr int64_t kRounding = kOne * 42 / 100;
// Values of a level lie nearer to 0 than its middle: by 1/32 of a step.
constexpr int64_t kLevelUnits = 32;
constexpr int kMaxNumRounds = 50;

}  // namespace

TransformLevels LevelsOf(const uint8_t* descriptor, const TransformCode& code) {
  Values values;
  for (size_t i = 0; i < values.size(); ++i) values[i] = int64_t{descriptor[i]} - code.mean[i];
  Transform(false, &values);
  TransformLevels levels;
  for (size_t i = 0; i < values.size(); ++i) {
    const int64_t level = std::min(kMaxLevel, (std::abs(values[i]) / code.step + kRounding) / kOne);
    levels[i] = static_cast<int16_t>(values[i] < 0 ? -level : level);
  }
  return levels;
}

void DescriptorOf(const TransformLevels& levels, const TransformCode& code, uint8_t* descriptor) {
  Values values;
  for (size_t i = 0; i < values.size(); ++i) {
    const int64_t level = levels[i];
    values[i] = code.step * (kLevelUnits * level - (level > 0 ? 1 : 0) + (level < 0 ? 1 : 0));
  }
  Transform(true, &values);
  constexpr int64_t kUnit = kOne * kLevelUnits;
  for (size_t i = 0; i < values.size(); ++i) {
    const int64_t value = code.mean[i] + ((values[i] + kUnit / 2) >> std::countr_zero(uint64_t{kUnit}));
    descriptor[i] = static_cast<uint8_t>(std::clamp<int64_t>(value, 0, 255));
  }
}

TransformCode QuantizeByTransform(int step, DescriptorMatrix* descriptors) {
  TransformCode code{.step = step};
  const Eigen::Index count = descriptors->rows();
  if (count == 0) return code;
  for (int i = 0; i < kSiftDescriptorDim; ++i) {
    const int64_t sum = descriptors->col(i).cast<int64_t>().sum();
    code.mean[i] = static_cast<uint8_t>((sum + count / 2) / count);
  }
  QuantizeByCode(code, descriptors);
  return code;
}

void QuantizeByCode(const TransformCode& code, DescriptorMatrix* descriptors) {
  for (Eigen::Index row = 0; row < descriptors->rows(); ++row) {
    uint8_t* descriptor = descriptors->data() + row * kSiftDescriptorDim;
    TransformLevels levels = LevelsOf(descriptor, code);
    // Values cut off at 0 or 255 change coefficients: usually by less than a level.
    for (int round = 0; round < kMaxNumRounds; ++round) {
      DescriptorOf(levels, code, descriptor);
      const TransformLevels next = LevelsOf(descriptor, code);
      if (next == levels) break;
      levels = next;
    }
  }
}

int FrequencyOf(int coefficient) {
  constexpr std::array<int, kNumOrientations> kPeriods = {0, 1, 1, 2, 2, 3, 3, 4};
  return coefficient / (kNumOrientations * kNumCells) + coefficient / kNumOrientations % kNumCells +
         kPeriods[coefficient % kNumOrientations];
}

}  // namespace cairn
