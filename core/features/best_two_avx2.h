#pragma once

// Vectors and keys of the 256-bit kernels.  Included by their files only, each compiled with its own flags:
// hence the anonymous namespace.

#include <immintrin.h>

#include <cstdint>

namespace cairn {
namespace {

struct Avx2Keys {
  static constexpr int kLanes = 8;
  static constexpr int kKeyBits = 32;
  using Vector = __m256i;
  static Vector Load(const uint32_t* p) { return _mm256_load_si256(reinterpret_cast<const __m256i*>(p)); }
  static void Store(uint32_t* p, Vector v) { _mm256_store_si256(reinterpret_cast<__m256i*>(p), v); }
  static Vector Set1(uint32_t value) { return _mm256_set1_epi32(static_cast<int>(value)); }
  static Vector Iota() { return _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7); }
  static Vector Sub(Vector a, Vector b) { return _mm256_sub_epi32(a, b); }
  static Vector Or(Vector a, Vector b) { return _mm256_or_si256(a, b); }
  static Vector Min(Vector a, Vector b) { return _mm256_min_epu32(a, b); }
  static Vector Max(Vector a, Vector b) { return _mm256_max_epu32(a, b); }
  static Vector ShiftLeft(Vector a, int bits) { return _mm256_sll_epi32(a, _mm_cvtsi32_si128(bits)); }
  template <int kDistance>
  static Vector Rotate(Vector a) {
    return _mm256_permutevar8x32_epi32(a,
                                       _mm256_and_si256(_mm256_add_epi32(Iota(), Set1(kDistance)), Set1(7)));
  }
  static uint32_t First(Vector a) { return static_cast<uint32_t>(_mm256_cvtsi256_si32(a)); }
};

}  // namespace
}  // namespace cairn
