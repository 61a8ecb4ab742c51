// Vectors of 128 bits in the notation that GCC and Clang share; the baseline of x86-64 and ARMv8 has them.
#include <cstring>

#include "core/features/best_two_sweep.h"

namespace cairn {
namespace {

using Vector16 = uint16_t __attribute__((vector_size(16)));

struct PortableKeys {
  static constexpr int kLanes = 4;
  static constexpr int kKeyBits = 31;  // SSE2 compares signed
  static constexpr int kRowOffset = 0;
  static constexpr int kNumBias = 0;
  static constexpr uint32_t kSumStart = 0;
  static constexpr int kTileGroups = 32;
  using Vector = uint32_t __attribute__((vector_size(16)));
  using Signed = int32_t __attribute__((vector_size(16)));
  static Vector Load(const uint32_t* p) {
    Vector v;
    std::memcpy(&v, p, sizeof(v));
    return v;
  }
  static void Store(uint32_t* p, Vector v) { std::memcpy(p, &v, sizeof(v)); }
  static Vector Set1(uint32_t value) { return Vector{value, value, value, value}; }
  static Vector Iota() { return Vector{0, 1, 2, 3}; }
  static Vector Sub(Vector a, Vector b) { return a - b; }
  static Vector Or(Vector a, Vector b) { return a | b; }
  static Vector Min(Vector a, Vector b) { return (Signed)a < (Signed)b ? a : b; }
  static Vector Max(Vector a, Vector b) { return (Signed)a > (Signed)b ? a : b; }
  static Vector ShiftLeft(Vector a, int bits) { return a << bits; }
  template <int k>
  static Vector Rotate(Vector a) {
    return Vector{a[k % 4], a[(k + 1) % 4], a[(k + 2) % 4], a[(k + 3) % 4]};
  }
  static uint32_t First(Vector a) { return a[0]; }

  // Even and odd values, in 16 bits each.
  struct Operand {
    Vector16 even, odd;
  };
  static Operand Split(Vector bytes) {
    const auto words = (Vector16)bytes;
    return {words & 0xFF, words >> 8};
  }
  static Operand LoadColumn(const uint32_t* p) { return Split(Load(p)); }
  static Operand LoadRow(const uint32_t* p) { return Split(Set1(*p)); }
  static Vector AddHalves(Vector sum, Vector16 halves) {
    const auto words = (Vector)halves;
    return sum + (words & 0xFFFF) + (words >> 16);
  }
};

struct Portable : PortableKeys {
  static constexpr bool kPartial = false;
  static constexpr int kRowBlock = 2;
  static constexpr int kGroupBlock = 2;
  static Vector StartSum(const uint32_t*) { return Vector{}; }
  static Vector DotAdd(Vector sum, Operand column, Operand row) {
    return AddHalves(AddHalves(sum, column.even * row.even), column.odd * row.odd);
  }
};

struct PortableSmall : PortableKeys {
  static constexpr bool kPartial = true;
  static constexpr int kRowBlock = 4;
  static constexpr int kGroupBlock = 2;
  using Partial = Vector16;
  static Partial StartPartial(const uint32_t*) { return Partial{}; }
  static Partial DotAdd(Partial sum, Operand column, Operand row) {
    return sum + column.even * row.even + column.odd * row.odd;
  }
  static Vector Widen(Vector sum, Partial partial) { return AddHalves(sum, partial); }
};

}  // namespace

const BestTwoKernel kBestTwoPortable = CAIRN_BEST_TWO_KERNEL(Portable);
const BestTwoKernel kBestTwoPortableSmall = CAIRN_BEST_TWO_KERNEL(PortableSmall);

}  // namespace cairn
