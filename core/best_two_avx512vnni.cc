// Compiled with -mavx512f -mavx512bw -mavx512vl -mavx512vnni.
#include <immintrin.h>

#include "core/best_two_sweep.h"

namespace cairn {
namespace {

struct Avx512Vnni {
  static constexpr int kLanes = 16;
  static constexpr int kNumChunks = 32;
  static constexpr int kRowBlock = 8;
  static constexpr int kTileGroups = 12;
  using Vector = __m512i;
  static Vector Load(const int32_t* p) { return _mm512_loadu_si512(p); }
  static void Store(int32_t* p, Vector v) { _mm512_storeu_si512(p, v); }
  static Vector Set1(int32_t value) { return _mm512_set1_epi32(value); }
  static Vector Iota() { return _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15); }
  static Vector Add(Vector a, Vector b) { return _mm512_add_epi32(a, b); }
  // Columns unsigned, rows signed.
  static Vector DotAdd(Vector sum, Vector columns, Vector row) {
    return _mm512_dpbusd_epi32(sum, columns, row);
  }
  static void UpdateBestTwo(Vector value, Vector idx, int32_t* best, int32_t* second, int32_t* best_idx) {
    const Vector old_best = Load(best);
    const __mmask16 is_better = _mm512_cmpgt_epi32_mask(value, old_best);
    Store(second, _mm512_max_epi32(Load(second), _mm512_min_epi32(value, old_best)));
    Store(best, _mm512_max_epi32(value, old_best));
    _mm512_mask_storeu_epi32(best_idx, is_better, idx);
  }
};

}  // namespace

void SweepAvx512Vnni(const BestTwoSweep& sweep) { best_two_internal::SweepAll<Avx512Vnni>(sweep); }

}  // namespace cairn
