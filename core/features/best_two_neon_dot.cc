// Compiled with -march=armv8.2-a+dotprod.
#include <arm_neon.h>

#include "core/features/best_two_sweep.h"

namespace cairn {
namespace {

struct NeonDot {
  static constexpr int kLanes = 4;
  static constexpr int kKeyBits = 32;
  static constexpr int kRowOffset = 0;
  static constexpr int kNumBias = 0;
  static constexpr bool kPartial = false;
  static constexpr int kRowBlock = 4;
  static constexpr int kGroupBlock = 6;
  static constexpr int kTileGroups = 36;
  using Vector = uint32x4_t;
  using Operand = uint8x16_t;
  static Vector Load(const uint32_t* p) { return vld1q_u32(p); }
  static void Store(uint32_t* p, Vector v) { vst1q_u32(p, v); }
  static Vector Set1(uint32_t value) { return vdupq_n_u32(value); }
  static Vector Iota() { return Vector{0, 1, 2, 3}; }
  static Vector Sub(Vector a, Vector b) { return vsubq_u32(a, b); }
  static Vector Or(Vector a, Vector b) { return vorrq_u32(a, b); }
  static Vector Min(Vector a, Vector b) { return vminq_u32(a, b); }
  static Vector Max(Vector a, Vector b) { return vmaxq_u32(a, b); }
  static Vector ShiftLeft(Vector a, int bits) { return vshlq_u32(a, vdupq_n_s32(bits)); }
  template <int kDistance>
  static Vector Rotate(Vector a) {
    return vextq_u32(a, a, kDistance);
  }
  static uint32_t First(Vector a) { return vgetq_lane_u32(a, 0); }
  static Operand LoadColumn(const uint32_t* p) { return vreinterpretq_u8_u32(vld1q_u32(p)); }
  static Operand LoadRow(const uint32_t* p) { return vreinterpretq_u8_u32(vld1q_dup_u32(p)); }
  static Vector StartSum(const uint32_t*) { return vdupq_n_u32(0); }
  static Vector DotAdd(Vector sum, Operand column, Operand row) { return vdotq_u32(sum, column, row); }
};

}  // namespace

const BestTwoKernel kBestTwoNeonDot = CAIRN_BEST_TWO_KERNEL(NeonDot);

}  // namespace cairn
