#pragma once

// The sweep for any instruction set V.  Included by the kernel files only.  V provides
//   kLanes, kKeyBits, kRowOffset, kNumBias     as in BestTwoKernel
//   kRowBlock (divides kLanes), kGroupBlock    dot products whose sums are in registers: rows, column groups
//   kTileGroups                                column groups that stay in the first-level cache
//   Vector (of kLanes words), Load, Store, Set1, Iota, Sub, Or, Min, Max (of keys), ShiftLeft, Rotate<k>
//   Operand, LoadColumn, LoadRow               one chunk, of kLanes columns or of one row in all lanes
//   DotAdd(sum, column, row)                   sum + the four products of each lane
// and, where kPartial, sums 8 chunks in narrower lanes: Partial, LoadPartial, PartialDotAdd, Widen.

#include "core/best_two_kernel.h"

namespace cairn::best_two_internal {

inline constexpr int kNumChunks = 32;

// sums[r][g] = dot products of row r with the columns of group g.
template <class V, int R, int G>
[[gnu::always_inline]] inline void Dots(const uint32_t* rows, const uint32_t* columns, const uint32_t* bias,
                                        typename V::Vector (&sums)[R][G]) {
  constexpr int L = V::kLanes;
#pragma GCC unroll 8
  for (int g = 0; g < G; ++g) {
    auto start = V::Set1(V::kSumStart);
    if constexpr (V::kNumBias > 0) start = V::Load(bias + g * L);
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) sums[r][g] = start;
  }
#pragma GCC unroll 1
  for (int chunk = 0; chunk < kNumChunks; ++chunk) {
    typename V::Operand column[G];
#pragma GCC unroll 8
    for (int g = 0; g < G; ++g) column[g] = V::LoadColumn(columns + (g * kNumChunks + chunk) * L);
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) {
      const auto row = V::LoadRow(rows + chunk * L + r);
#pragma GCC unroll 8
      for (int g = 0; g < G; ++g) sums[r][g] = V::DotAdd(sums[r][g], column[g], row);
    }
  }
}

template <class V, int R, int G>
[[gnu::always_inline]] inline void DotsOfSmall(const uint32_t* rows, const uint32_t* columns,
                                               const uint32_t* bias, typename V::Vector (&sums)[R][G]) {
  constexpr int L = V::kLanes;
  constexpr int kNumSteps = kNumChunks / kBestTwoPartialChunks;
#pragma GCC unroll 8
  for (int r = 0; r < R; ++r) {
#pragma GCC unroll 8
    for (int g = 0; g < G; ++g) sums[r][g] = V::Set1(V::kSumStart);
  }
#pragma GCC unroll 1
  for (int step = 0; step < kNumSteps; ++step) {
    typename V::Partial partial[R][G];
#pragma GCC unroll 8
    for (int g = 0; g < G; ++g) {
      typename V::Partial start{};
      if constexpr (V::kNumBias > 0) start = V::LoadPartial(bias + (g * V::kNumBias + step) * L);
#pragma GCC unroll 8
      for (int r = 0; r < R; ++r) partial[r][g] = start;
    }
#pragma GCC unroll 8
    for (int i = 0; i < kBestTwoPartialChunks; ++i) {
      const int chunk = step * kBestTwoPartialChunks + i;
      typename V::Operand column[G];
#pragma GCC unroll 8
      for (int g = 0; g < G; ++g) column[g] = V::LoadColumn(columns + (g * kNumChunks + chunk) * L);
#pragma GCC unroll 8
      for (int r = 0; r < R; ++r) {
        const auto row = V::LoadRow(rows + chunk * L + r);
#pragma GCC unroll 8
        for (int g = 0; g < G; ++g) partial[r][g] = V::PartialDotAdd(partial[r][g], column[g], row);
      }
    }
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) {
#pragma GCC unroll 8
      for (int g = 0; g < G; ++g) sums[r][g] = V::Widen(sums[r][g], partial[r][g]);
    }
  }
}

// best and second of keys seen so far, `key` being a new one.
template <class V>
[[gnu::always_inline]] inline void Keep(typename V::Vector key, typename V::Vector* best,
                                        typename V::Vector* second) {
  *second = V::Max(*second, V::Min(key, *best));
  *best = V::Max(key, *best);
}

// R rows from `row` of the block against the G column groups from `group`.
template <class V, int R, int G>
inline void SweepBlock(const BestTwoSweep& s, int row, int group) {
  using Vector = typename V::Vector;
  constexpr int L = V::kLanes;
  const uint32_t* rows = s.rows + static_cast<int64_t>(row / L) * kNumChunks * L + row % L;
  const uint32_t* columns = s.columns + static_cast<int64_t>(group) * kNumChunks * L;
  const uint32_t* bias = s.bias + static_cast<int64_t>(group) * V::kNumBias * L;
  Vector sums[R][G];
  if constexpr (V::kPartial) {
    DotsOfSmall<V, R, G>(rows, columns, bias, sums);
  } else {
    Dots<V, R, G>(rows, columns, bias, sums);
  }
  const uint32_t last = (uint32_t{1} << s.index_bits) - 1;
#pragma GCC unroll 8
  for (int g = 0; g < G; ++g) {
    uint32_t* column_state = s.column_keys + static_cast<int64_t>(group + g) * 2 * L;
    const Vector column_idx = V::Sub(V::Set1(last - static_cast<uint32_t>((group + g) * L)), V::Iota());
    Vector column_best = V::Load(column_state), column_second = V::Load(column_state + L);
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) {
      const Vector dot = V::ShiftLeft(sums[r][g], s.index_bits);
      Keep<V>(V::Or(dot, V::Set1(last - static_cast<uint32_t>(row + r))), &column_best, &column_second);
      sums[r][g] = V::Or(dot, column_idx);
    }
    V::Store(column_state, column_best);
    V::Store(column_state + L, column_second);
  }
#pragma GCC unroll 8
  for (int r = 0; r < R; ++r) {
    uint32_t* row_state = s.row_states + static_cast<int64_t>(row + r) * 2 * L;
    Vector best = V::Load(row_state), second = V::Load(row_state + L);
#pragma GCC unroll 8
    for (int g = 0; g < G; ++g) Keep<V>(sums[r][g], &best, &second);
    V::Store(row_state, best);
    V::Store(row_state + L, second);
  }
}

// The last groups of a tile, fewer than kGroupBlock.
template <class V, int G>
inline void SweepRemainder(const BestTwoSweep& s, int row, int group, int num_groups) {
  if constexpr (G > 0) {
    if (num_groups == G) {
      SweepBlock<V, V::kRowBlock, G>(s, row, group);
    } else {
      SweepRemainder<V, G - 1>(s, row, group, num_groups);
    }
  }
}

template <class V, int kDistance>
inline void MergeLanes(typename V::Vector* best, typename V::Vector* second) {
  if constexpr (kDistance > 0) {
    const auto other_best = V::template Rotate<kDistance>(*best);
    *second = V::Max(*second, V::template Rotate<kDistance>(*second));
    *second = V::Max(*second, V::Min(*best, other_best));
    *best = V::Max(*best, other_best);
    MergeLanes<V, kDistance / 2>(best, second);
  }
}

template <class V>
inline void SweepAll(const BestTwoSweep& s) {
  constexpr int L = V::kLanes;
  const int num_rows = s.num_row_groups * L;
  const auto zero = V::Set1(0);
  for (int i = 0; i < 2 * num_rows; ++i) V::Store(s.row_states + static_cast<int64_t>(i) * L, zero);
  for (int i = 0; i < 2 * s.num_column_groups; ++i)
    V::Store(s.column_keys + static_cast<int64_t>(i) * L, zero);

  for (int begin = 0; begin < s.num_column_groups; begin += V::kTileGroups) {
    const int end =
        begin + V::kTileGroups < s.num_column_groups ? begin + V::kTileGroups : s.num_column_groups;
    for (int row = 0; row < num_rows; row += V::kRowBlock) {
      int group = begin;
      for (; group + V::kGroupBlock <= end; group += V::kGroupBlock)
        SweepBlock<V, V::kRowBlock, V::kGroupBlock>(s, row, group);
      SweepRemainder<V, V::kGroupBlock - 1>(s, row, group, end - group);
    }
  }
  for (int row = 0; row < num_rows; ++row) {
    uint32_t* row_state = s.row_states + static_cast<int64_t>(row) * 2 * L;
    auto best = V::Load(row_state), second = V::Load(row_state + L);
    MergeLanes<V, L / 2>(&best, &second);
    s.row_keys[2 * row] = V::First(best);
    s.row_keys[2 * row + 1] = V::First(second);
  }
}

}  // namespace cairn::best_two_internal

// The table row of a kernel.
#define CAIRN_BEST_TWO_KERNEL(V) \
  { best_two_internal::SweepAll<V>, V::kLanes, V::kRowOffset, V::kNumBias, V::kKeyBits }
