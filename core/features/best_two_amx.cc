// Compiled with -mavx512f -mavx512bw -mavx512vl -mavx512vbmi2 -mamx-tile -mamx-int8.
//
// One instruction multiplies 16 rows by 16 columns, 64 values deep: a group of packed columns is its second
// operand as it lies in memory, a group of rows becomes its first by transposition.  The products go through
// the first-level cache to the vector units, which keep the best two; they take longer for that than the
// multiplication, so the next block is multiplied meanwhile.
#include "core/features/best_two_avx512.h"
#include "core/features/best_two_sweep.h"

namespace cairn {
namespace {

using best_two_internal::AnyChunks;
using best_two_internal::Keep;
using best_two_internal::MergeLanes;
using best_two_internal::SiftChunks;
using Keys = Avx512Keys;
using Vector = Keys::Vector;

constexpr int kLanes = Keys::kLanes;
constexpr int kTileWords = 16 * 16;
constexpr int kMaxSteps = kMaxChunks / 16;
// Groups of rows and of columns whose products are in tiles at once.
constexpr int kRowGroups = 2;
constexpr int kColumnGroups = 2;

// Writes all of `data`: the compiler does not see that tiles read it.
inline void FinishWrites(const void* data) { asm volatile("" ::"r"(data) : "memory"); }

// The operand of ldtilecfg, palette 1 (Intel's Software Developer's Manual, volume 1, chapter 18).
struct alignas(64) TileConfig {
  uint8_t palette = 1;
  uint8_t start_row = 0;
  uint8_t reserved[14] = {};
  uint16_t num_row_bytes[16] = {};
  uint8_t num_rows[16] = {};
};

// How the chunks of a descriptor are cut into steps of `depth`, a tile's rows: the last one ends with the
// descriptor, and where it overlaps the one before it, its rows hold 0.
struct Steps {
  constexpr explicit Steps(int num_chunks)
      : num_chunks(num_chunks), depth(num_chunks < 16 ? num_chunks : 16), num((num_chunks + 15) / 16) {}
  constexpr int Begin(int step) const {
    return 16 * step + depth <= num_chunks ? 16 * step : num_chunks - depth;
  }

  int num_chunks;
  int depth;
  int num;
};

// Tiles 0 to 3: products, row group by row group; 4, 5: rows; 6, 7: columns.
void Configure(const Steps& steps) {
  TileConfig config;
  for (int tile = 0; tile < 8; ++tile) {
    const bool is_columns = tile >= 6, is_rows = tile == 4 || tile == 5;
    config.num_rows[tile] = static_cast<uint8_t>(is_columns ? steps.depth : 16);
    config.num_row_bytes[tile] = static_cast<uint16_t>(is_rows ? 4 * steps.depth : 64);
  }
  FinishWrites(&config);
  _tile_loadconfig(&config);
}

// Groups of rows: their values as the first operand wants them, of each group and step a tile of 16 rows x 16
// words, and what is kept of them.
struct alignas(64) RowBlock {
  uint32_t tiles[kRowGroups][kMaxSteps][kTileWords];
  uint32_t keys[kRowGroups * kLanes];  // their indices as keys have them, in the upper bits
  uint32_t terms[kRowGroups * kLanes];
  // Best and second of each row, in each lane.
  uint32_t states[kRowGroups * kLanes][2][kLanes];
};

// products[row][column group][column]
using Products = uint32_t[kRowGroups * kLanes][kColumnGroups][kLanes];

void LoadRows(const BestTwoSweep& s, const Steps& steps, int row_group, int num_groups, RowBlock* block) {
  const uint32_t last = (uint32_t{1} << s.index_bits) - 1;
  for (int r = 0; r < num_groups; ++r) {
    const uint32_t* words = s.rows + static_cast<int64_t>(row_group + r) * steps.num_chunks * kLanes;
    for (int step = 0; step < steps.num; ++step) {
      const int begin = steps.Begin(step);
      for (int lane = 0; lane < kLanes; ++lane) {
        for (int i = 0; i < steps.depth; ++i)
          block->tiles[r][step][lane * 16 + i] =
              begin + i < 16 * step ? 0 : words[(begin + i) * kLanes + lane];
      }
    }
  }
  for (int i = 0; i < num_groups * kLanes; ++i) {
    block->keys[i] = (last - static_cast<uint32_t>(row_group * kLanes + i)) << (32 - s.index_bits);
    block->terms[i] = s.row_terms == nullptr ? 0 : s.row_terms[row_group * kLanes + i];
    for (int k = 0; k < 2; ++k) Keys::Store(block->states[i][k], Keys::Set1(0));
  }
  FinishWrites(block);
}

// The best two of G groups of columns while rows are offered to them.
template <class Chunks, int G>
class ColumnsKept {
 public:
  [[gnu::always_inline]] ColumnsKept(const BestTwoSweep& s, int group)
      : states_(s.column_keys + static_cast<int64_t>(group) * 2 * kLanes),
        bits_(Keys::Set1(static_cast<uint32_t>(s.index_bits))) {
    const uint32_t last = (uint32_t{1} << s.index_bits) - 1;
#pragma GCC unroll 2
    for (int g = 0; g < G; ++g) {
      best_[g] = Keys::Load(states_ + (2 * g) * kLanes);
      second_[g] = Keys::Load(states_ + (2 * g + 1) * kLanes);
      keys_[g] = Keys::ShiftLeft(
          Keys::Sub(Keys::Set1(last - static_cast<uint32_t>((group + g) * kLanes)), Keys::Iota()),
          32 - s.index_bits);
      if constexpr (Chunks::kHasTerms)
        terms_[g] = Keys::Load(s.column_terms + static_cast<int64_t>(group + g) * kLanes);
    }
  }

  // Offers products of the rows from `begin` to `end` to them and to the rows.
  [[gnu::always_inline]] void Offer(const Products& products, int begin, int end, RowBlock* rows) {
#pragma GCC unroll 4
    for (int row = begin; row < end; ++row) {
      Vector row_best = Keys::Load(rows->states[row][0]), row_second = Keys::Load(rows->states[row][1]);
#pragma GCC unroll 2
      for (int g = 0; g < G; ++g) {
        Vector product = Keys::Load(products[row][g]);
        if constexpr (Chunks::kHasTerms)
          product = Keys::Sub(Keys::Sub(product, terms_[g]), Keys::Set1(rows->terms[row]));
        Keep<Keys>(Key(product, Keys::Set1(rows->keys[row])), &best_[g], &second_[g]);
        Keep<Keys>(Key(product, keys_[g]), &row_best, &row_second);
      }
      Keys::Store(rows->states[row][0], row_best);
      Keys::Store(rows->states[row][1], row_second);
    }
  }

  [[gnu::always_inline]] void Store() const {
#pragma GCC unroll 2
    for (int g = 0; g < G; ++g) {
      Keys::Store(states_ + (2 * g) * kLanes, best_[g]);
      Keys::Store(states_ + (2 * g + 1) * kLanes, second_[g]);
    }
  }

 private:
  // The product before the index, which is in the upper bits.
  Vector Key(Vector product, Vector index) const { return _mm512_shldv_epi32(product, index, bits_); }

  uint32_t* states_;
  Vector bits_;
  Vector best_[G], second_[G], keys_[G], terms_[G];
};

// All products of R groups of rows with G groups of columns, from `columns` on.  `meanwhile(k, num)` is
// called num times.
template <class Chunks, int R, int G, class F>
[[gnu::always_inline]] inline void Multiply(const BestTwoSweep& s, const RowBlock& rows, int group,
                                            Products* products, const F& meanwhile) {
  const Steps steps(Chunks::Of(s));
  constexpr int kRowStride = 16 * sizeof(uint32_t);
  const int64_t group_words = static_cast<int64_t>(steps.num_chunks) * kLanes;
  const uint32_t* columns = s.columns + group * group_words;
  _tile_zero(0);
  if constexpr (G > 1) _tile_zero(1);
  if constexpr (R > 1) _tile_zero(2);
  if constexpr (R > 1 && G > 1) _tile_zero(3);
  const int num = 4 * steps.num;
#pragma GCC unroll 2
  for (int step = 0; step < steps.num; ++step) {
    const uint32_t* column = columns + steps.Begin(step) * kLanes;
    _tile_loadd(6, column, kRowStride);
    _tile_loadd(4, rows.tiles[0][step], kRowStride);
    _tile_dpbuud(0, 4, 6);
    meanwhile(4 * step, num);
    if constexpr (R > 1) {
      _tile_loadd(5, rows.tiles[1][step], kRowStride);
      _tile_dpbuud(2, 5, 6);
    }
    meanwhile(4 * step + 1, num);
    if constexpr (G > 1) {
      _tile_loadd(7, column + group_words, kRowStride);
      _tile_dpbuud(1, 4, 7);
      meanwhile(4 * step + 2, num);
      if constexpr (R > 1) _tile_dpbuud(3, 5, 7);
      meanwhile(4 * step + 3, num);
    }
  }
  constexpr int kStride = kColumnGroups * kRowStride;
  _tile_stored(0, (*products)[0][0], kStride);
  if constexpr (G > 1) _tile_stored(1, (*products)[0][1], kStride);
  if constexpr (R > 1) _tile_stored(2, (*products)[kLanes][0], kStride);
  if constexpr (R > 1 && G > 1) _tile_stored(3, (*products)[kLanes][1], kStride);
}

template <class Chunks, int R, int G>
void OfferAll(const BestTwoSweep& s, const Products& products, int group, RowBlock* rows) {
  ColumnsKept<Chunks, G> kept(s, group);
  kept.Offer(products, 0, R * kLanes, rows);
  kept.Store();
}

// R groups of rows against all columns.
template <class Chunks, int R>
void SweepRows(const BestTwoSweep& s, int row_group) {
  constexpr int G = kColumnGroups;
  RowBlock rows;
  LoadRows(s, Steps(Chunks::Of(s)), row_group, R, &rows);
  alignas(64) Products products[2];
  const auto nothing = [](int, int) __attribute__((always_inline)){};
  const int num_pairs = s.num_column_groups / G;
  if (num_pairs > 0) {
    Multiply<Chunks, R, G>(s, rows, 0, &products[0], nothing);
    for (int pair = 1; pair < num_pairs; ++pair) {
      const Products& before = products[(pair - 1) % 2];
      ColumnsKept<Chunks, G> kept(s, G * (pair - 1));
      Multiply<Chunks, R, G>(
          s, rows, G * pair, &products[pair % 2], [&](int i, int num) __attribute__((always_inline)) {
            kept.Offer(before, R * kLanes * i / num, R * kLanes * (i + 1) / num, &rows);
          });
      kept.Store();
    }
    OfferAll<Chunks, R, G>(s, products[(num_pairs - 1) % 2], G * (num_pairs - 1), &rows);
  }
  if (s.num_column_groups % G != 0) {
    Multiply<Chunks, R, 1>(s, rows, s.num_column_groups - 1, &products[0], nothing);
    OfferAll<Chunks, R, 1>(s, products[0], s.num_column_groups - 1, &rows);
  }
  for (int row = 0; row < R * kLanes; ++row) {
    auto best = Keys::Load(rows.states[row][0]), second = Keys::Load(rows.states[row][1]);
    MergeLanes<Keys, kLanes / 2>(&best, &second);
    uint32_t* row_keys = s.row_keys + 2 * (static_cast<int64_t>(row_group) * kLanes + row);
    row_keys[0] = Keys::First(best);
    row_keys[1] = Keys::First(second);
  }
}

template <class Chunks>
void SweepAll(const BestTwoSweep& s) {
  for (int i = 0; i < 2 * s.num_column_groups; ++i)
    Keys::Store(s.column_keys + static_cast<int64_t>(i) * kLanes, Keys::Set1(0));
  Configure(Steps(Chunks::Of(s)));
  int row_group = 0;
  for (; row_group + kRowGroups <= s.num_row_groups; row_group += kRowGroups)
    SweepRows<Chunks, kRowGroups>(s, row_group);
  if (row_group < s.num_row_groups) SweepRows<Chunks, 1>(s, row_group);
  _tile_release();
}

void Sweep(const BestTwoSweep& s) {
  if (s.column_terms != nullptr) {
    SweepAll<AnyChunks>(s);
  } else {
    SweepAll<SiftChunks>(s);
  }
}

}  // namespace

const BestTwoKernel kBestTwoAmx = {
    .sweep = Sweep, .lanes = kLanes, .row_offset = 0, .num_bias = 0, .key_bits = Keys::kKeyBits};

}  // namespace cairn
