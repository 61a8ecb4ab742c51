// Compiled with -mavx512f -mavx512bw -mavx512vl -mavx512vnni.
#include "core/features/best_two_avx512.h"
#include "core/features/best_two_sweep.h"

namespace cairn {
namespace {

struct Avx512Vnni : Avx512Keys {
  static constexpr int kRowOffset = 128;
  static constexpr int kNumBias = 1;
  static constexpr bool kPartial = false;
  static constexpr int kRowBlock = 4;
  static constexpr int kGroupBlock = 6;
  static constexpr int kTileGroups = 12;
  using Operand = Vector;
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
