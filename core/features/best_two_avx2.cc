// Compiled with -mavx2.
#include "core/features/best_two_avx2.h"

#include "core/features/best_two_sweep.h"

namespace cairn {
namespace {

// Any values: widened to 16 bits on the way, even and odd ones.
struct Avx2 : Avx2Keys {
  static constexpr int kRowOffset = 0;
  static constexpr int kNumBias = 0;
  static constexpr bool kPartial = false;
  static constexpr int kRowBlock = 4;
  static constexpr int kGroupBlock = 2;
  static constexpr int kTileGroups = 16;
  struct Operand {
    Vector even, odd;
  };
  static Operand Split(Vector bytes) {
    return {_mm256_and_si256(bytes, _mm256_set1_epi16(0xFF)), _mm256_srli_epi16(bytes, 8)};
  }
  static Operand LoadColumn(const uint32_t* p) { return Split(Load(p)); }
  static Operand LoadRow(const uint32_t* p) { return Split(Set1(*p)); }
  static Vector StartSum(const uint32_t*) { return _mm256_setzero_si256(); }
  static Vector DotAdd(Vector sum, Operand column, Operand row) {
    sum = _mm256_add_epi32(sum, _mm256_madd_epi16(column.even, row.even));
    return _mm256_add_epi32(sum, _mm256_madd_epi16(column.odd, row.odd));
  }
};

// Values whose products fit: rows less 64 are signed 8-bit (values up to 191), every pair of products fits
// into 16 bits, and so do 16 of them, as the bias compensates for the 64 and subtracts 2^15.
struct Avx2Small : Avx2Keys {
  static constexpr int kRowOffset = 64;
  static constexpr int kNumBias = 4;
  static constexpr uint32_t kSumStart = 8 << 15;
  static constexpr bool kPartial = true;
  static constexpr int kRowBlock = 4;
  static constexpr int kGroupBlock = 2;
  static constexpr int kTileGroups = 16;
  using Operand = Vector;
  using Partial = Vector;
  static Operand LoadColumn(const uint32_t* p) { return Load(p); }
  static Operand LoadRow(const uint32_t* p) { return Set1(*p); }
  static Partial StartPartial(const uint32_t* bias) { return Load(bias); }
  static Partial DotAdd(Partial sum, Operand column, Operand row) {
    return _mm256_add_epi16(sum, _mm256_maddubs_epi16(column, row));
  }
  static Vector Widen(Vector sum, Partial partial) {
    return _mm256_add_epi32(sum, _mm256_madd_epi16(partial, _mm256_set1_epi16(1)));
  }
};

}  // namespace

const BestTwoKernel kBestTwoAvx2 = CAIRN_BEST_TWO_KERNEL(Avx2);
const BestTwoKernel kBestTwoAvx2Small = CAIRN_BEST_TWO_KERNEL(Avx2Small);

}  // namespace cairn
