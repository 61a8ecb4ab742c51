#pragma once

// The sweep for any instruction set V.  Included by the kernel files only.  V provides
//   kLanes, kKeyBits, kRowOffset, kNumBias     as in BestTwoKernel
//   kRowBlock (divides kLanes), kGroupBlock    dot products whose sums are in registers: rows, column groups
//   kTileGroups                                column groups that stay in the first-level cache
//   Vector (of kLanes words), Load, Store, Set1, Iota, Sub, Or, Min, Max (of keys), ShiftLeft, Rotate<k>
//   Operand, LoadColumn, LoadRow               one chunk, of kLanes columns or of one row in all lanes
//   DotAdd(sum, column, row)                   sum + the four products of each lane
//   kPartial                                   whether 8 chunks are summed in narrower lanes first: then
//     Partial, StartPartial(bias), Widen(sum, partial), kSumStart; else StartSum(bias)

#include <utility>

#include "core/features/best_two_kernel.h"

namespace cairn::best_two_internal {

// How many chunks a descriptor has: a constant for SIFT, since it makes the addresses of columns constants.
struct SiftChunks {
  static constexpr bool kHasTerms = false;
  static constexpr int Of(const BestTwoSweep&) { return kNumSiftChunks; }
};
struct AnyChunks {
  static constexpr bool kHasTerms = true;
  static int Of(const BestTwoSweep& s) { return s.num_chunks; }
};

// The functions below name every element of `sums` by a constant, through folds over index packs, and never
// through a closure: otherwise g++ 12 does not keep the array in registers.
template <int N>
using Sequence = std::make_integer_sequence<int, N>;
template <int... kIdx>
using Indices = std::integer_sequence<int, kIdx...>;

template <class T, int R, int G, int... kG, int... kR>
[[gnu::always_inline]] inline void Fill(const T (&start)[G], T (&sums)[R][G], Indices<kG...>,
                                        Indices<kR...>) {
  const auto fill_row = [](const T(&from)[G], T(&to)[G]) __attribute__((always_inline)) {
    ((to[kG] = from[kG]), ...);
  };
  (fill_row(start, sums[kR]), ...);
}

template <class V, class Sum, int G, int... kG>
[[gnu::always_inline]] inline void AddRow(const typename V::Operand (&columns)[G], typename V::Operand row,
                                          Sum (&sums)[G], Indices<kG...>) {
  ((sums[kG] = V::DotAdd(sums[kG], columns[kG], row)), ...);
}

// sums[r][g] += products of one chunk of row r with the columns of group g.
template <class V, class Sum, int R, int G, int... kR, int... kG>
[[gnu::always_inline]] inline void AddChunk(const uint32_t* rows, const uint32_t* columns, int num_chunks,
                                            Sum (&sums)[R][G], Indices<kR...>, Indices<kG...>) {
  const typename V::Operand column[G] = {V::LoadColumn(columns + kG * num_chunks * V::kLanes)...};
  (AddRow<V, Sum, G>(column, V::LoadRow(rows + kR), sums[kR], Sequence<G>()), ...);
}

template <class V, int R, int G, int... kG>
[[gnu::always_inline]] inline void WidenRow(const typename V::Partial (&partial)[G],
                                            typename V::Vector (&sums)[G], Indices<kG...>) {
  ((sums[kG] = V::Widen(sums[kG], partial[kG])), ...);
}

template <class V, int G, int... kG>
[[gnu::always_inline]] inline void LessTerms(const uint32_t* terms, typename V::Vector (&sums)[G],
                                             Indices<kG...>) {
  ((sums[kG] = V::Sub(sums[kG], V::Load(terms + kG * V::kLanes))), ...);
}
template <class V, int G, int... kG>
[[gnu::always_inline]] inline void LessTerm(uint32_t term, typename V::Vector (&sums)[G], Indices<kG...>) {
  ((sums[kG] = V::Sub(sums[kG], V::Set1(term))), ...);
}

// sums[r][g] = dot products of row r with the columns of group g.
template <class V, class Chunks, int R, int G, int... kR, int... kG>
[[gnu::always_inline]] inline void Dots(const uint32_t* rows, const uint32_t* columns, const uint32_t* bias,
                                        const uint32_t* column_terms, int num_chunks,
                                        typename V::Vector (&sums)[R][G], Indices<kR...>, Indices<kG...>) {
  using Vector = typename V::Vector;
  constexpr int L = V::kLanes;
  if constexpr (V::kPartial) {
    const Vector zero[G] = {(static_cast<void>(kG), V::Set1(V::kSumStart))...};
    Fill<Vector, R, G>(zero, sums, Sequence<G>(), Sequence<R>());
#pragma GCC unroll 1
    for (int step = 0; step < kNumSiftChunks / kBestTwoPartialChunks; ++step) {
      const typename V::Partial start[G] = {V::StartPartial(bias + (kG * V::kNumBias + step) * L)...};
      typename V::Partial partial[R][G];
      Fill<typename V::Partial, R, G>(start, partial, Sequence<G>(), Sequence<R>());
#pragma GCC unroll 8
      for (int i = 0; i < kBestTwoPartialChunks; ++i) {
        AddChunk<V, typename V::Partial, R, G>(rows, columns, num_chunks, partial, Sequence<R>(),
                                               Sequence<G>());
        rows += L;
        columns += L;
      }
      (WidenRow<V, R, G>(partial[kR], sums[kR], Sequence<G>()), ...);
    }
  } else {
    Vector start[G] = {V::StartSum(bias + kG * V::kNumBias * L)...};
    if constexpr (Chunks::kHasTerms) LessTerms<V, G>(column_terms, start, Sequence<G>());
    Fill<Vector, R, G>(start, sums, Sequence<G>(), Sequence<R>());
#pragma GCC unroll 1
    for (int chunk = 0; chunk < num_chunks; ++chunk) {
      AddChunk<V, Vector, R, G>(rows, columns, num_chunks, sums, Sequence<R>(), Sequence<G>());
      rows += L;
      columns += L;
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

// The columns of group g with all rows, the first of which has key index `row_key`.
template <class V, int R, int G, int... kR>
[[gnu::always_inline]] inline void KeepColumns(const typename V::Vector (&dots)[R][G], int g,
                                               uint32_t row_key, uint32_t* state, Indices<kR...>) {
  auto best = V::Load(state), second = V::Load(state + V::kLanes);
  (Keep<V>(V::Or(dots[kR][g], V::Set1(row_key - kR)), &best, &second), ...);
  V::Store(state, best);
  V::Store(state + V::kLanes, second);
}

template <class V, int G, int... kG>
[[gnu::always_inline]] inline void KeepRow(const typename V::Vector (&dots)[G],
                                           const typename V::Vector (&column_keys)[G], uint32_t* state,
                                           Indices<kG...>) {
  auto best = V::Load(state), second = V::Load(state + V::kLanes);
  (Keep<V>(V::Or(dots[kG], column_keys[kG]), &best, &second), ...);
  V::Store(state, best);
  V::Store(state + V::kLanes, second);
}

template <class V, int G, int... kG>
[[gnu::always_inline]] inline void ShiftRow(int bits, typename V::Vector (&sums)[G], Indices<kG...>) {
  ((sums[kG] = V::ShiftLeft(sums[kG], bits)), ...);
}

// R rows from `row` of the block against the G column groups from `group`.
template <class V, class Chunks, int R, int G, int... kR, int... kG>
[[gnu::always_inline]] inline void SweepBlock(const BestTwoSweep& s, int row, int group, Indices<kR...>,
                                              Indices<kG...>) {
  using Vector = typename V::Vector;
  constexpr int L = V::kLanes;
  Vector sums[R][G];
  const int num_chunks = Chunks::Of(s);
  const uint32_t* column_terms = nullptr;
  if constexpr (Chunks::kHasTerms) column_terms = s.column_terms + static_cast<int64_t>(group) * L;
  Dots<V, Chunks, R, G>(s.rows + static_cast<int64_t>(row / L) * num_chunks * L + row % L,
                        s.columns + static_cast<int64_t>(group) * num_chunks * L,
                        s.bias + static_cast<int64_t>(group) * V::kNumBias * L, column_terms, num_chunks,
                        sums, Sequence<R>(), Sequence<G>());
  if constexpr (Chunks::kHasTerms) (LessTerm<V, G>(s.row_terms[row + kR], sums[kR], Sequence<G>()), ...);
  (ShiftRow<V, G>(s.index_bits, sums[kR], Sequence<G>()), ...);
  const uint32_t last = (uint32_t{1} << s.index_bits) - 1;
  uint32_t* column_state = s.column_keys + static_cast<int64_t>(group) * 2 * L;
  (KeepColumns<V, R, G>(sums, kG, last - static_cast<uint32_t>(row), column_state + kG * 2 * L,
                        Sequence<R>()),
   ...);
  const Vector first = V::Sub(V::Set1(last - static_cast<uint32_t>(group * L)), V::Iota());
  const Vector column_keys[G] = {V::Sub(first, V::Set1(kG * L))...};
  uint32_t* row_state = s.row_states + static_cast<int64_t>(row) * 2 * L;
  (KeepRow<V, G>(sums[kR], column_keys, row_state + kR * 2 * L, Sequence<G>()), ...);
}

// The last groups of a tile, fewer than kGroupBlock.
template <class V, class Chunks, int G>
inline void SweepRemainder(const BestTwoSweep& s, int row, int group, int num_groups) {
  if constexpr (G > 0) {
    if (num_groups == G) {
      SweepBlock<V, Chunks, V::kRowBlock, G>(s, row, group, Sequence<V::kRowBlock>(), Sequence<G>());
    } else {
      SweepRemainder<V, Chunks, G - 1>(s, row, group, num_groups);
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

template <class V, class Chunks>
inline void SweepTiles(const BestTwoSweep& s) {
  constexpr int L = V::kLanes;
  // Wider descriptors, fewer of them in the first-level cache.
  const int num_fit = V::kTileGroups * kNumSiftChunks / Chunks::Of(s);
  const int tile_groups = num_fit > V::kGroupBlock ? num_fit : V::kGroupBlock;
  const int num_rows = s.num_row_groups * L;
  const auto zero = V::Set1(0);
  for (int i = 0; i < 2 * num_rows; ++i) V::Store(s.row_states + static_cast<int64_t>(i) * L, zero);
  for (int i = 0; i < 2 * s.num_column_groups; ++i)
    V::Store(s.column_keys + static_cast<int64_t>(i) * L, zero);

  for (int begin = 0; begin < s.num_column_groups; begin += tile_groups) {
    const int end = begin + tile_groups < s.num_column_groups ? begin + tile_groups : s.num_column_groups;
    for (int row = 0; row < num_rows; row += V::kRowBlock) {
      int group = begin;
      for (; group + V::kGroupBlock <= end; group += V::kGroupBlock)
        SweepBlock<V, Chunks, V::kRowBlock, V::kGroupBlock>(s, row, group, Sequence<V::kRowBlock>(),
                                                            Sequence<V::kGroupBlock>());
      SweepRemainder<V, Chunks, V::kGroupBlock - 1>(s, row, group, end - group);
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

template <class V>
inline void SweepAll(const BestTwoSweep& s) {
  if constexpr (!V::kPartial) {
    if (s.column_terms != nullptr) return SweepTiles<V, AnyChunks>(s);
  }
  SweepTiles<V, SiftChunks>(s);
}

}  // namespace cairn::best_two_internal

// The table row of a kernel.
#define CAIRN_BEST_TWO_KERNEL(V) \
  { best_two_internal::SweepAll<V>, V::kLanes, V::kRowOffset, V::kNumBias, V::kKeyBits }
