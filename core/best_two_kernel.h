#pragma once

// The inner loops of FindBestTwo, one file per instruction set; each is compiled with that set's flags, so
// nothing here may instantiate code that other files share (no standard containers).

#include <cstdint>

namespace cairn {

// One sweep over all dot products of `num_rows` rows with `num_groups * lanes` columns.
//
// A row or column is packed in chunks of 4 bytes: with VNNI 32 chunks of four 8-bit values (columns unsigned,
// rows less 128 and signed; the bias of a column, 128 times its sum, restores the product), else 64 of two
// 16-bit values (bias 0).  A column of padding has bias -1 and zeros: no result picks it.
struct BestTwoSweep {
  const int32_t* rows = nullptr;         // num_rows x chunks
  const int32_t* columns = nullptr;      // num_groups x chunks x lanes
  const int32_t* column_bias = nullptr;  // num_groups x lanes
  int num_rows = 0;
  int num_groups = 0;  // even
  // Running best, second best and index of the best: of every row per lane (num_rows x lanes), of every
  // column (num_groups x lanes).  Set to -1 by the caller.
  int32_t *row_best = nullptr, *row_second = nullptr, *row_idx = nullptr;
  int32_t *column_best = nullptr, *column_second = nullptr, *column_idx = nullptr;
};

void SweepPortable(const BestTwoSweep& sweep);    // 4 lanes, 16-bit
void SweepAvx2(const BestTwoSweep& sweep);        // 8 lanes, 16-bit
void SweepAvx512Vnni(const BestTwoSweep& sweep);  // 16 lanes, 8-bit

}  // namespace cairn
