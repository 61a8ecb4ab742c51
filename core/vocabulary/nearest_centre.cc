#include "core/vocabulary/nearest_centre.h"

#include <algorithm>
#include <array>
#include <limits>

#include "core/features/wide_clones.h"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#endif

namespace cairn {
namespace {

// Of (c - o) (x - o) summed over the values, only c (x - o) depends on the centre.
CAIRN_WIDE_CLONES int32_t DotWithCentred(const uint8_t* centre, const int16_t* centred, int num_values) {
  int32_t dot = 0;
  for (int d = 0; d < num_values; ++d) dot += static_cast<int32_t>(centre[d]) * centred[d];
  return dot;
}

int NearestCentrePortable(const uint8_t* centres, int num_centres, const uint8_t* descriptor,
                          const DescriptorSpace& space) {
  std::array<int16_t, kMaxDescriptorDim> centred;
  for (int d = 0; d < space.num_values; ++d) centred[d] = static_cast<int16_t>(descriptor[d] - space.offset);
  int nearest = 0;
  int32_t largest = std::numeric_limits<int32_t>::min();
  for (int i = 0; i < num_centres; ++i) {
    const int32_t dot =
        DotWithCentred(centres + static_cast<size_t>(i) * space.num_values, centred.data(), space.num_values);
    if (dot > largest) {
      largest = dot;
      nearest = i;
    }
  }
  return nearest;
}

#if defined(__x86_64__) && defined(__GNUC__)
constexpr int kNumVectors = kSiftDescriptorDim / 16;  // others take the portable way

__attribute__((target("avx2"))) inline __m256i Widen(const uint8_t* values) {
  return _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(values)));
}

// Eight sums that make up the dot product: 8-bit values widened to 16 bits, pairs of products to 32.
__attribute__((target("avx2"))) inline __m256i PartialDots(const uint8_t* centre, const __m256i* wide) {
  __m256i even = _mm256_madd_epi16(Widen(centre), wide[0]);
  __m256i odd = _mm256_madd_epi16(Widen(centre + 16), wide[1]);
  for (int i = 2; i < kNumVectors; i += 2) {
    even = _mm256_add_epi32(even, _mm256_madd_epi16(Widen(centre + 16 * i), wide[i]));
    odd = _mm256_add_epi32(odd, _mm256_madd_epi16(Widen(centre + 16 * i + 16), wide[i + 1]));
  }
  return _mm256_add_epi32(even, odd);
}

// The sums of four vectors.
__attribute__((target("avx2"))) inline void Sum4(__m256i a, __m256i b, __m256i c, __m256i d, int32_t* sums) {
  const __m256i pairs = _mm256_hadd_epi32(_mm256_hadd_epi32(a, b), _mm256_hadd_epi32(c, d));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(sums),
                   _mm_add_epi32(_mm256_castsi256_si128(pairs), _mm256_extracti128_si256(pairs, 1)));
}

__attribute__((target("avx2"))) int NearestCentreAvx2(const uint8_t* centres, int num_centres,
                                                      const uint8_t* descriptor) {
  __m256i wide[kNumVectors];
  for (int i = 0; i < kNumVectors; ++i) wide[i] = Widen(descriptor + 16 * i);
  int nearest = 0;
  int32_t largest = -1;
  for (int first = 0; first < num_centres; first += 4) {
    __m256i partial[4];
    const int count = std::min(4, num_centres - first);
    for (int k = 0; k < 4; ++k) {
      const int centre = first + std::min(k, count - 1);
      partial[k] = PartialDots(centres + static_cast<size_t>(centre) * kSiftDescriptorDim, wide);
    }
    int32_t dots[4];
    Sum4(partial[0], partial[1], partial[2], partial[3], dots);
    for (int k = 0; k < count; ++k) {
      if (dots[k] > largest) {
        largest = dots[k];
        nearest = first + k;
      }
    }
  }
  return nearest;
}
#endif

}  // namespace

int NearestCentre(const uint8_t* centres, int num_centres, const uint8_t* descriptor,
                  const DescriptorSpace& space) {
#if defined(__x86_64__) && defined(__GNUC__)
  static const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
  if (has_avx2 && space.is_sift()) return NearestCentreAvx2(centres, num_centres, descriptor);
#endif
  return NearestCentrePortable(centres, num_centres, descriptor, space);
}

CAIRN_WIDE_CLONES void AddDescriptor(const uint8_t* descriptor, int num_values, int32_t* sums) {
  for (int d = 0; d < num_values; ++d) sums[d] += descriptor[d];
}

CAIRN_WIDE_CLONES void LowerSquaredDistances(const uint8_t* descriptors, int64_t num_descriptors,
                                             const uint8_t* centre, int num_values, int32_t* nearest) {
  for (int64_t i = 0; i < num_descriptors; ++i) {
    const uint8_t* descriptor = descriptors + i * num_values;
    int32_t sum = 0;
    for (int d = 0; d < num_values; ++d) {
      const auto difference = static_cast<int16_t>(descriptor[d] - centre[d]);
      sum += static_cast<int32_t>(difference) * difference;
    }
    nearest[i] = std::min(nearest[i], sum);
  }
}

}  // namespace cairn
