// The sweep with 16 lanes and signed 8-bit rows, as the AVX-512 VNNI kernel instantiates it, emulated: its
// blocking, keys and lane merges are tested on any processor.
#include "core/features/best_two_sweep.h"

#include <algorithm>
#include <array>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

struct Emulated {
  static constexpr int kLanes = 16;
  static constexpr int kKeyBits = 32;
  static constexpr int kRowOffset = 128;
  static constexpr int kNumBias = 1;
  static constexpr bool kPartial = false;
  static constexpr int kRowBlock = 4;
  static constexpr int kGroupBlock = 6;
  static constexpr int kTileGroups = 12;
  using Vector = std::array<uint32_t, kLanes>;
  using Operand = Vector;
  template <class F>
  static Vector Make(F f) {
    Vector v;
    for (int i = 0; i < kLanes; ++i) v[i] = static_cast<uint32_t>(f(i));
    return v;
  }
  static Vector Load(const uint32_t* p) {
    return Make([&](int i) { return p[i]; });
  }
  static void Store(uint32_t* p, const Vector& v) { std::copy(v.begin(), v.end(), p); }
  static Vector Set1(uint32_t value) {
    return Make([&](int) { return value; });
  }
  static Vector Iota() {
    return Make([](int i) { return i; });
  }
  static Vector Sub(const Vector& a, const Vector& b) {
    return Make([&](int i) { return a[i] - b[i]; });
  }
  static Vector Or(const Vector& a, const Vector& b) {
    return Make([&](int i) { return a[i] | b[i]; });
  }
  static Vector Min(const Vector& a, const Vector& b) {
    return Make([&](int i) { return std::min(a[i], b[i]); });
  }
  static Vector Max(const Vector& a, const Vector& b) {
    return Make([&](int i) { return std::max(a[i], b[i]); });
  }
  static Vector ShiftLeft(const Vector& a, int bits) {
    return Make([&](int i) { return a[i] << bits; });
  }
  template <int kDistance>
  static Vector Rotate(const Vector& a) {
    return Make([&](int i) { return a[(i + kDistance) % kLanes]; });
  }
  static uint32_t First(const Vector& a) { return a[0]; }
  static Operand LoadColumn(const uint32_t* p) { return Load(p); }
  static Operand LoadRow(const uint32_t* p) { return Set1(*p); }
  static Vector StartSum(const uint32_t* bias) { return Load(bias); }
  static Vector DotAdd(const Vector& sum, const Vector& column, const Vector& row) {
    return Make([&](int i) {
      int32_t dot = 0;
      for (int byte = 0; byte < 32; byte += 8)
        dot += static_cast<uint8_t>(column[i] >> byte) * static_cast<int8_t>(row[i] >> byte);
      return sum[i] + static_cast<uint32_t>(dot);
    });
  }
};

using Values = std::vector<std::array<uint8_t, 128>>;

Values RandomValues(int num, int max_value, uint64_t seed) {
  Random random(seed);
  Values values(num);
  for (auto& v : values) {
    for (uint8_t& x : v) x = static_cast<uint8_t>(random.UniformInt(0, max_value));
  }
  return values;
}

std::vector<uint32_t> Packed(const Values& values, int offset) {
  std::vector<uint32_t> words(values.size() * 32);
  for (size_t i = 0; i < values.size(); ++i) {
    for (int d = 0; d < 128; ++d) {
      words[(i / 16 * 32 + d / 4) * 16 + i % 16] |=
          static_cast<uint32_t>(static_cast<uint8_t>(values[i][d] - offset)) << (d % 4 * 8);
    }
  }
  return words;
}

// The two largest keys of `values` with one descriptor.
std::array<uint32_t, 2> OracleKeys(const std::array<uint8_t, 128>& one, const Values& values, int bits) {
  std::vector<uint32_t> keys(2, 0);
  for (size_t i = 0; i < values.size(); ++i) {
    uint32_t dot = 0;
    for (int d = 0; d < 128; ++d) dot += one[d] * values[i][d];
    keys.push_back(dot << bits | ((uint32_t{1} << bits) - 1 - static_cast<uint32_t>(i)));
  }
  std::partial_sort(keys.begin(), keys.begin() + 2, keys.end(), std::greater<>());
  return {keys[0], keys[1]};
}

TEST(BestTwoSweep, SixteenLanesFindTheTwoLargestKeysOfRowsAndColumns) {
  for (const auto& [num_row_groups, num_column_groups] :
       {std::pair(1, 1), std::pair(2, 5), std::pair(3, 6), std::pair(1, 19), std::pair(2, 25)}) {
    for (const auto& [max_value, bits] : {std::pair(1, 13), std::pair(60, 13), std::pair(255, 9)}) {
      const Values rows = RandomValues(16 * num_row_groups, max_value, 1);
      const Values columns = RandomValues(16 * num_column_groups, max_value, 2);
      const std::vector<uint32_t> packed_rows = Packed(rows, 128), packed_columns = Packed(columns, 0);
      std::vector<uint32_t> bias, row_states(rows.size() * 32), row_keys(rows.size() * 2),
          column_keys(columns.size() * 2);
      for (const auto& column : columns) {
        uint32_t sum = 0;
        for (const uint8_t x : column) sum += 128 * x;
        bias.push_back(sum);
      }
      best_two_internal::SweepAll<Emulated>({.rows = packed_rows.data(),
                                             .columns = packed_columns.data(),
                                             .bias = bias.data(),
                                             .num_chunks = kNumSiftChunks,
                                             .num_row_groups = num_row_groups,
                                             .num_column_groups = num_column_groups,
                                             .index_bits = bits,
                                             .row_states = row_states.data(),
                                             .row_keys = row_keys.data(),
                                             .column_keys = column_keys.data()});
      for (size_t i = 0; i < rows.size(); ++i) {
        const std::array<uint32_t, 2> expected = OracleKeys(rows[i], columns, bits);
        EXPECT_EQ(row_keys[2 * i], expected[0]) << i;
        EXPECT_EQ(row_keys[2 * i + 1], expected[1]) << i;
      }
      for (size_t i = 0; i < columns.size(); ++i) {
        const std::array<uint32_t, 2> expected = OracleKeys(columns[i], rows, bits);
        EXPECT_EQ(column_keys[i / 16 * 32 + i % 16], expected[0]) << i;
        EXPECT_EQ(column_keys[i / 16 * 32 + 16 + i % 16], expected[1]) << i;
      }
    }
  }
}

}  // namespace
}  // namespace cairn
