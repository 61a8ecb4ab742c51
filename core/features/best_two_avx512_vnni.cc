// Compiled with -mavx512f -mavx512bw -mavx512vl -mavx512vnni.
#include <immintrin.h>

#include "core/features/best_two_sweep.h"

namespace cairn {
namespace {

struct Avx512Vnni {
  static constexpr int kLanes = 16;
  static constexpr int kKeyBits = 32;
  static constexpr int kRowOffset = 128;
  static constexpr int kNumBias = 1;
  static constexpr bool kPartial = false;
  static constexpr int kRowBlock = 4;
  static constexpr int kGroupBlock = 6;
  static constexpr int kTileGroups = 12;
  using Vector = __m512i;
  using Operand = Vector;
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
  static Operand LoadColumn(const uint32_t* p) { return Load(p); }
  static Operand LoadRow(const uint32_t* p) { return Set1(*p); }
  static Vector StartSum(const uint32_t* bias) { return Load(bias); }
  // Columns unsigned, rows signed.
  static Vector DotAdd(Vector sum, Operand column, Operand row) {
    return _mm512_dpbusd_epi32(sum, column, row);
  }
};

}  // namespace

const BestTwoKernel kBestTwoAvx512Vnni = CAIRN_BEST_TWO_KERNEL(Avx512Vnni);

}  // namespace cairn
