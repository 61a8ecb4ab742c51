#pragma once

// Vectors and keys of the 512-bit kernels.  Included by their files only, each compiled with its own flags:
// hence the anonymous namespace.

#include <immintrin.h>

#include <cstdint>

namespace cairn {
namespace {

struct Avx512Keys {
  static constexpr int kLanes = 16;
  static constexpr int kKeyBits = 32;
  using Vector = __m512i;
  static Vector Load(const uint32_t* p) { return _mm512_load_si512(p); }
  static void Store(uint32_t* p, Vector v) { _mm512_store_si512(p, v); }
  static Vector Set1(uint32_t value) { return _mm512_set1_epi32(static_cast<int>(value)); }
  static Vector Iota() { return _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15); }
  static Vector Sub(Vector a, Vector b) { return _mm512_sub_epi32(a, b); }
  static Vector Or(Vector a, Vector b) { return _mm512_or_si512(a, b); }
  static Vector Min(Vector a, Vector b) { return _mm512_min_epu32(a, b); }
  static Vector Max(Vector a, Vector b) { return _mm512_max_epu32(a, b); }
  static Vector ShiftLeft(Vector a, int bits) { return _mm512_sll_epi32(a, _mm_cvtsi32_si128(bits)); }
  template <int kDistance>
  static Vector Rotate(Vector a) {
    return _mm512_permutexvar_epi32(_mm512_and_si512(_mm512_add_epi32(Iota(), Set1(kDistance)), Set1(15)), a);
  }
  static uint32_t First(Vector a) {
    return static_cast<uint32_t>(_mm_cvtsi128_si32(_mm512_castsi512_si128(a)));
  }
};

}  // namespace
}  // namespace cairn
