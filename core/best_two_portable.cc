#include "core/best_two_sweep.h"

#include <cstring>

namespace cairn {
namespace {

struct Portable {
  static constexpr int kLanes = 4;
  static constexpr int kNumChunks = 64;
  static constexpr int kRowBlock = 2;
  static constexpr int kTileGroups = 16;
  struct Vector {
    int32_t lane[kLanes];
  };
  static Vector Load(const int32_t* p) {
    Vector v;
    std::memcpy(&v, p, sizeof(v));
    return v;
  }
  static Vector Set1(int32_t value) { return {{value, value, value, value}}; }
  static Vector Iota() { return {{0, 1, 2, 3}}; }
  static Vector Add(const Vector& a, const Vector& b) {
    Vector sum;
    for (int i = 0; i < kLanes; ++i) sum.lane[i] = a.lane[i] + b.lane[i];
    return sum;
  }
  static Vector DotAdd(const Vector& sum, const Vector& columns, const Vector& row) {
    // Two 16-bit halves, both small and positive: no sign to care for.
    Vector result;
    for (int i = 0; i < kLanes; ++i) {
      const auto c = static_cast<uint32_t>(columns.lane[i]), r = static_cast<uint32_t>(row.lane[i]);
      result.lane[i] =
          sum.lane[i] + static_cast<int32_t>((c & 0xFFFF) * (r & 0xFFFF) + (c >> 16) * (r >> 16));
    }
    return result;
  }
  static void UpdateBestTwo(const Vector& value, const Vector& idx, int32_t* best, int32_t* second,
                            int32_t* best_idx) {
    for (int i = 0; i < kLanes; ++i) {
      const int32_t v = value.lane[i];
      if (v > best[i]) {
        second[i] = best[i];
        best[i] = v;
        best_idx[i] = idx.lane[i];
      } else if (v > second[i]) {
        second[i] = v;
      }
    }
  }
};

}  // namespace

void SweepPortable(const BestTwoSweep& sweep) { best_two_internal::SweepAll<Portable>(sweep); }

}  // namespace cairn
