// Compiled with -mavx2.
#include <immintrin.h>

#include "core/best_two_sweep.h"

namespace cairn {
namespace {

struct Avx2 {
  static constexpr int kLanes = 8;
  static constexpr int kNumChunks = 64;
  static constexpr int kRowBlock = 4;
  static constexpr int kTileGroups = 8;
  using Vector = __m256i;
  static Vector Load(const int32_t* p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)); }
  static void Store(int32_t* p, Vector v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), v); }
  static Vector Set1(int32_t value) { return _mm256_set1_epi32(value); }
  static Vector Iota() { return _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7); }
  static Vector Add(Vector a, Vector b) { return _mm256_add_epi32(a, b); }
  static Vector DotAdd(Vector sum, Vector columns, Vector row) {
    return _mm256_add_epi32(sum, _mm256_madd_epi16(columns, row));
  }
  static void UpdateBestTwo(Vector value, Vector idx, int32_t* best, int32_t* second, int32_t* best_idx) {
    const Vector old_best = Load(best);
    const Vector is_better = _mm256_cmpgt_epi32(value, old_best);
    Store(second, _mm256_max_epi32(Load(second), _mm256_min_epi32(value, old_best)));
    Store(best, _mm256_max_epi32(value, old_best));
    Store(best_idx, _mm256_blendv_epi8(Load(best_idx), idx, is_better));
  }
};

}  // namespace

void SweepAvx2(const BestTwoSweep& sweep) { best_two_internal::SweepAll<Avx2>(sweep); }

}  // namespace cairn
