#pragma once

// The sweep for any instruction set V, which provides: kLanes, kNumChunks, kRowBlock, kTileGroups, Vector,
// Load, Store, Set1, Iota, Add, DotAdd(sum, columns, row) = sum + the chunks' products, and UpdateBestTwo.
// Included by the kernel files only.

#include "core/best_two_kernel.h"

namespace cairn::best_two_internal {

// Rows [row, row + R) against columns of the groups [group_begin, group_end), two groups at a time.
template <class V, int R>
inline void SweepBlock(BestTwoSweep s, int row, int group_begin, int group_end) {
  using Vector = typename V::Vector;
  constexpr int L = V::kLanes;
  const int32_t* rows = s.rows + static_cast<int64_t>(row) * V::kNumChunks;
  for (int group = group_begin; group < group_end; group += 2) {
    const int32_t* columns0 = s.columns + static_cast<int64_t>(group) * V::kNumChunks * L;
    const int32_t* columns1 = columns0 + static_cast<int64_t>(V::kNumChunks) * L;
    Vector sums[R][2];
    const Vector bias0 = V::Load(s.column_bias + group * L), bias1 = V::Load(s.column_bias + group * L + L);
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) sums[r][0] = bias0, sums[r][1] = bias1;
#pragma GCC unroll 8
    for (int chunk = 0; chunk < V::kNumChunks; ++chunk) {
      const Vector column0 = V::Load(columns0 + chunk * L), column1 = V::Load(columns1 + chunk * L);
#pragma GCC unroll 8
      for (int r = 0; r < R; ++r) {
        const Vector value = V::Set1(rows[r * V::kNumChunks + chunk]);
        sums[r][0] = V::DotAdd(sums[r][0], column0, value);
        sums[r][1] = V::DotAdd(sums[r][1], column1, value);
      }
    }
#pragma GCC unroll 2
    for (int g = 0; g < 2; ++g) {
      const int first_column = (group + g) * L;
      const Vector column_idx = V::Add(V::Set1(first_column), V::Iota());
#pragma GCC unroll 8
      for (int r = 0; r < R; ++r) {
        const int64_t row_state = static_cast<int64_t>(row + r) * L;
        V::UpdateBestTwo(sums[r][g], column_idx, s.row_best + row_state, s.row_second + row_state,
                         s.row_idx + row_state);
        V::UpdateBestTwo(sums[r][g], V::Set1(row + r), s.column_best + first_column,
                         s.column_second + first_column, s.column_idx + first_column);
      }
    }
  }
}

template <class V>
inline void SweepAll(const BestTwoSweep& s) {
  // Columns of one tile (32 KiB or less) stay in the first-level cache while all rows pass.
  const int tile = V::kTileGroups;
  for (int begin = 0; begin < s.num_groups; begin += tile) {
    const int end = begin + tile < s.num_groups ? begin + tile : s.num_groups;
    int row = 0;
    for (; row + V::kRowBlock <= s.num_rows; row += V::kRowBlock)
      SweepBlock<V, V::kRowBlock>(s, row, begin, end);
    for (; row < s.num_rows; ++row) SweepBlock<V, 1>(s, row, begin, end);
  }
}

}  // namespace cairn::best_two_internal
