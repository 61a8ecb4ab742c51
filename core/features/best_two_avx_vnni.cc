// Compiled with -mavx2 -mavxvnni.
#include "core/features/best_two_avx2.h"
#include "core/features/best_two_sweep.h"

namespace cairn {
namespace {

struct AvxVnni : Avx2Keys {
  static constexpr int kRowOffset = 128;
  static constexpr int kNumBias = 1;
  static constexpr bool kPartial = false;
  static constexpr int kRowBlock = 4;
  static constexpr int kGroupBlock = 3;
  static constexpr int kTileGroups = 18;
  using Operand = Vector;
  static Operand LoadColumn(const uint32_t* p) { return Load(p); }
  static Operand LoadRow(const uint32_t* p) { return Set1(*p); }
  static Vector StartSum(const uint32_t* bias) { return Load(bias); }
  // Columns unsigned, rows signed.
  static Vector DotAdd(Vector sum, Operand column, Operand row) {
    return _mm256_dpbusd_avx_epi32(sum, column, row);
  }
};

}  // namespace

const BestTwoKernel kBestTwoAvxVnni = CAIRN_BEST_TWO_KERNEL(AvxVnni);

}  // namespace cairn
