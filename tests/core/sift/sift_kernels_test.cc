// Without OpenCV, so that it is compiled for other processors too (test_on_aarch64.sh).
#include "core/sift/sift_kernels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/sift/choose_kernels.h"
#include "core/sift/gaussian.h"
#include "tests/core/sift/wide_kernels.h"

namespace cairn {
namespace {

constexpr int kCols = 300;
constexpr int kStride = 336;
constexpr int kRows = 90;

// Those of this processor, and those of its widest relative without its registers.
std::vector<const SiftKernels*> AllKernels() {
  std::vector<const SiftKernels*> kernels = UsableSiftKernels();
  kernels.push_back(&kSiftWide);
  return kernels;
}

// Waves of whole numbers, which every system computes alike.  `bend` makes another picture.
std::vector<float> Waves(int bend) {
  std::vector<float> waves(static_cast<size_t>(kStride) * kRows + 64);
  const auto triangle = [](int at, int period) { return std::abs(at % period * 2 - period); };
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kStride; ++x) {
      waves[static_cast<size_t>(y) * kStride + x] =
          static_cast<float>(triangle(3 * x + bend * y + 1000, 41) + triangle(2 * y * bend + x + 1000, 67) +
                             (x * 7919 + y * 104729) % 13);
    }
  }
  return waves;
}

// FNV-1a: of what is hashed nothing may differ.
class Hash {
 public:
  template <typename T>
  void Add(const T* values, size_t num) {
    const auto* bytes = reinterpret_cast<const uint8_t*>(values);
    for (size_t i = 0; i < num * sizeof(T); ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3;
  }
  uint64_t value() const { return value_; }

 private:
  uint64_t value_ = 0xcbf29ce484222325;
};

std::vector<float> Blurred(const SiftKernels& kernels, const std::vector<float>& level, int radius,
                           int num_rows) {
  const auto taps = GaussianTaps(radius * radius / 16.0, radius);
  std::vector<const float*> rows;
  for (int r = 0; r < num_rows + 2 * radius; ++r) rows.push_back(level.data() + r * kStride);
  std::vector<float> blurred(static_cast<size_t>(num_rows) * kStride);
  std::vector<float*> to;
  for (int r = 0; r < num_rows; ++r) to.push_back(blurred.data() + r * kStride);
  std::vector<float> padded(kSiftBatchRows * SiftPaddedStride(kCols));
  kernels.blur_rows({.rows = rows.data(),
                     .blurred = to.data(),
                     .num_rows = num_rows,
                     .taps = taps.data(),
                     .radius = radius,
                     .cols = kCols,
                     .padded = padded.data()});
  return blurred;
}

SiftPatch PatchAt(const std::vector<float>& level, int x, int y, int radius, double angle_deg,
                  const float* weights) {
  const SineCosine turn = ExactSineCosine(angle_deg);
  const float cell = static_cast<float>(radius) / 3.5f;
  return {.level = level.data(),
          .stride = kStride,
          .cols = kCols,
          .rows = kRows,
          .x = x,
          .y = y,
          .radius = radius,
          .weights = weights,
          .cosine = static_cast<float>(turn.cosine) / cell,
          .sine = static_cast<float>(turn.sine) / cell,
          .orientation = static_cast<float>(angle_deg / 45)};
}

// All that the kernels compute of two pictures.
uint64_t HashOfAll(const SiftKernels& kernels) {
  Hash hash;
  const std::vector<float> level = Waves(1);
  for (const int radius : {5, 6, 8, 10, 13}) {
    for (const int num_rows : {1, 8}) {
      const std::vector<float> blurred = Blurred(kernels, level, radius, num_rows);
      for (int r = 0; r < num_rows; ++r) hash.Add(blurred.data() + r * kStride, kCols);
    }
  }
  std::vector<uint8_t> near(kCols), other(kCols);
  for (int x = 0; x < kCols; ++x) {
    near[x] = static_cast<uint8_t>(level[x]);
    other[x] = static_cast<uint8_t>(level[kStride + x]);
  }
  std::vector<float> doubled(2 * kCols);
  kernels.double_row(near.data(), other.data(), kCols, doubled.data());
  hash.Add(doubled.data(), doubled.size());

  float weights[kSiftMaxPatchRadius + 1];
  for (const int radius : {1, 6, 17, kSiftMaxPatchRadius}) {
    GaussianWeights(radius * radius / 6.0, radius, weights);
    for (int i = 0; i < 40; ++i) {
      // Also at the borders, where a part of the patch is missing.
      const SiftPatch patch = PatchAt(level, i * 7, (i * 11) % kRows, radius, i * 9, weights);
      uint8_t root_sift[kSiftDim];
      kernels.describe(patch, root_sift);
      hash.Add(root_sift, kSiftDim);
      float histogram[kSiftDirections];
      kernels.orientation_histogram(patch, histogram);
      hash.Add(histogram, kSiftDirections);
    }
  }
  return hash.value();
}

// The same from every compiler and processor.
constexpr uint64_t kHashOfAll = 9196400665917019034u;

TEST(SiftKernels, EveryInstructionSetGivesTheSameBits) {
  for (const SiftKernels* kernels : AllKernels()) {
    EXPECT_EQ(HashOfAll(*kernels), kHashOfAll) << kernels->name;
  }
}

// Brute force [Lowe04 §3.1].
PooledVector<SiftCandidate> ExtremaOf(const std::vector<std::vector<float>>& levels, int begin, int end,
                                      int first_row, int num_rows, float threshold) {
  PooledVector<SiftCandidate> candidates;
  const auto difference = [&](int layer, int x, int y) {
    return levels[layer + 1][y * kStride + x] - levels[layer][y * kStride + x];
  };
  for (int y = first_row; y < first_row + num_rows; ++y) {
    for (int x = begin; x < end; ++x) {
      uint32_t found = 0;
      for (int layer = 1; layer <= kSiftLayers; ++layer) {
        const float value = difference(layer, x, y);
        bool most = value > threshold, least = value < -threshold;
        for (int i = 0; i < 27; ++i) {
          const float other = difference(layer + i / 9 - 1, x + i % 3 - 1, y + i / 3 % 3 - 1);
          most = most && value >= other;
          least = least && value <= other;
        }
        if (most || least) found |= 1u << (layer - 1);
      }
      if (found != 0) candidates.push_back({x, y, found});
    }
  }
  return candidates;
}

TEST(SiftKernels, ExtremaAreThoseOfBruteForce) {
  std::vector<std::vector<float>> levels;
  for (int l = 0; l < kSiftLevels; ++l) levels.push_back(Waves(l % 3 + l));
  const auto by_place = [](const SiftCandidate& a, const SiftCandidate& b) {
    return std::pair(a.y, a.x) < std::pair(b.y, b.x);
  };
  for (const SiftKernels* kernels : AllKernels()) {
    for (const auto& [begin, end] : {std::pair(20, 21), std::pair(21, 37), std::pair(16, 290)}) {
      for (const float threshold : {0.0f, 9.0f}) {
        SiftExtremaRows rows{
            .first_row = 30, .num_rows = 7, .begin = begin, .end = end, .threshold = threshold};
        for (int l = 0; l < kSiftLevels; ++l) {
          for (int r = 0; r < 9; ++r) rows.levels[l][r] = levels[l].data() + (29 + r) * kStride;
        }
        PooledVector<SiftCandidate> found(7 * kCols);
        found.resize(kernels->find_extrema(rows, found.data()));
        std::sort(found.begin(), found.end(), by_place);
        const PooledVector<SiftCandidate> expected = ExtremaOf(levels, begin, end, 30, 7, threshold);
        EXPECT_EQ(found, expected) << kernels->name << " " << begin << " " << threshold;
        EXPECT_TRUE(end - begin < 100 || expected.size() > 10);
      }
    }
  }
}

TEST(SiftKernels, BlurIsTheConvolutionWithAGaussianMirroredAtTheBorder) {
  const std::vector<float> level = Waves(2);
  const int radius = 8;
  const auto taps = GaussianTaps(radius * radius / 16.0, radius);
  const auto mirrored = [](int x) { return x < 0 ? -x : x >= kCols ? 2 * (kCols - 1) - x : x; };
  const std::vector<float> blurred = Blurred(*AllKernels()[0], level, radius, 3);
  for (int y = 0; y < 3; ++y) {
    for (const int x : {0, 1, 7, 100, kCols - 8, kCols - 1}) {
      double sum = 0;
      for (int i = -radius; i <= radius; ++i) {
        for (int j = -radius; j <= radius; ++j) {
          sum += static_cast<double>(taps[std::abs(i)]) * taps[std::abs(j)] *
                 level[(y + radius + i) * kStride + mirrored(x + j)];
        }
      }
      EXPECT_NEAR(blurred[y * kStride + x], sum, 1e-4) << x;
    }
  }
}

TEST(SiftKernels, DoubledRowIsInterpolatedBetweenPixelsCentres) {
  // 4 rows above: 0.75 x 8 + 0.25 x 4 = 7, and so for columns.
  const uint8_t near[] = {8, 8, 40}, other[] = {4, 4, 4};
  float doubled[6];
  for (const SiftKernels* kernels : AllKernels()) {
    kernels->double_row(near, other, 3, doubled);
    EXPECT_EQ(std::vector<float>(doubled, doubled + 6), (std::vector<float>{7, 7, 7, 13, 25, 31}));
  }
}

TEST(SiftKernels, GradientsGoToTheirDirections) {
  // A ramp that rises to the right and, of rows counted downwards, by `down` for each row.
  for (const auto& [right, down, direction] :
       {std::tuple(2, 0, 0), std::tuple(0, -2, 9), std::tuple(-2, 0, 18), std::tuple(0, 2, 27),
        std::tuple(2, -2, 5) /* 45 degrees: 4.5, rounded up */}) {
    std::vector<float> ramp(static_cast<size_t>(kStride) * kRows + 64);
    for (int i = 0; i < kStride * kRows; ++i)
      ramp[i] = static_cast<float>(right * (i % kStride) + down * (i / kStride));
    float weights[6], histogram[kSiftDirections];
    GaussianWeights(4, 5, weights);
    for (const SiftKernels* kernels : AllKernels()) {
      kernels->orientation_histogram(PatchAt(ramp, 50, 50, 5, 0, weights), histogram);
      double sum = 0;
      for (int i = -5; i <= 5; ++i) {
        for (int j = -5; j <= 5; ++j) sum += std::exp(-(i * i + j * j) / 8.0);
      }
      EXPECT_NEAR(histogram[direction], 2 * std::hypot(right, down) * sum, 1e-3);
      for (int b = 0; b < kSiftDirections; ++b) {
        EXPECT_TRUE(b == direction || histogram[b] == 0) << b;
      }
    }
  }
}

}  // namespace
}  // namespace cairn
