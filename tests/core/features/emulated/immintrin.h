// In the place of the compiler's header: its intrinsics in plain C++, by SIMD Everywhere, and those of tiles,
// which that lacks, after the pseudocode of Intel's manual.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#define SIMDE_NO_NATIVE
#define SIMDE_ENABLE_NATIVE_ALIASES
#include <simde/x86/avx512.h>
#define _mm256_dpbusd_avx_epi32 simde_mm256_dpbusd_epi32
#ifndef _mm512_shldv_epi32  // of SIMD Everywhere later than Debian 12 has
#define _mm512_shldv_epi32(a, b, bits)                  \
  simde_mm512_or_si512(simde_mm512_sllv_epi32(a, bits), \
                       simde_mm512_srlv_epi32(b, simde_mm512_sub_epi32(simde_mm512_set1_epi32(32), bits)))
#endif

namespace emulated_tiles {

struct Tile {
  int num_rows = 0, num_row_bytes = 0;
  uint8_t bytes[16][64] = {};
};
inline thread_local Tile tiles[8];
inline thread_local bool is_configured = false;

// What the processor answers with a fault ends the test.
inline void Require(bool holds) {
  if (!holds) std::abort();
}

inline Tile& At(int tile) {
  Require(is_configured && tile >= 0 && tile < 8 && tiles[tile].num_rows > 0);
  return tiles[tile];
}

inline void Configure(const void* config) {
  uint8_t bytes[64];
  std::memcpy(bytes, config, 64);
  Require(bytes[0] == 1 && bytes[1] == 0 && std::all_of(bytes + 2, bytes + 16, [](int b) { return b == 0; }));
  for (int i = 0; i < 8; ++i) {
    tiles[i] = {.num_rows = bytes[48 + i], .num_row_bytes = bytes[16 + 2 * i] | bytes[17 + 2 * i] << 8};
    Require(tiles[i].num_rows <= 16 && tiles[i].num_row_bytes <= 64);
  }
  is_configured = true;
}

inline void Load(Tile* tile, const void* base, int64_t stride) {
  std::memset(tile->bytes, 0, sizeof(tile->bytes));
  for (int row = 0; row < tile->num_rows; ++row)
    std::memcpy(tile->bytes[row], static_cast<const uint8_t*>(base) + row * stride, tile->num_row_bytes);
}

inline void Store(const Tile& tile, void* base, int64_t stride) {
  for (int row = 0; row < tile.num_rows; ++row)
    std::memcpy(static_cast<uint8_t*>(base) + row * stride, tile.bytes[row], tile.num_row_bytes);
}

// sums += rows (num_rows x depth x 4 bytes) times columns (depth x columns x 4 bytes), all unsigned.
inline void AddProducts(Tile* sums, const Tile& rows, const Tile& columns) {
  Require(rows.num_rows == sums->num_rows && columns.num_row_bytes == sums->num_row_bytes &&
          rows.num_row_bytes == 4 * columns.num_rows);
  for (int row = 0; row < sums->num_rows; ++row) {
    for (int column = 0; column < sums->num_row_bytes / 4; ++column) {
      uint32_t sum;
      std::memcpy(&sum, &sums->bytes[row][4 * column], 4);
      for (int i = 0; i < rows.num_row_bytes; ++i)
        sum += uint32_t{rows.bytes[row][i]} * columns.bytes[i / 4][4 * column + i % 4];
      std::memcpy(&sums->bytes[row][4 * column], &sum, 4);
    }
  }
}

}  // namespace emulated_tiles

#define _tile_loadconfig(config) emulated_tiles::Configure(config)
#define _tile_release() (emulated_tiles::is_configured = false)
#define _tile_zero(tile) std::memset(emulated_tiles::At(tile).bytes, 0, 16 * 64)
#define _tile_loadd(tile, base, stride) emulated_tiles::Load(&emulated_tiles::At(tile), base, stride)
#define _tile_stored(tile, base, stride) emulated_tiles::Store(emulated_tiles::At(tile), base, stride)
#define _tile_dpbuud(sums, rows, columns)                                          \
  emulated_tiles::AddProducts(&emulated_tiles::At(sums), emulated_tiles::At(rows), \
                              emulated_tiles::At(columns))
