#pragma once

// The inner loops of FindBestTwo, one file per instruction set; each is compiled with that set's flags, so
// nothing here may instantiate code that other files share (no standard containers).

#include <cstdint>

namespace cairn {

// All dot products of a block of rows with a block of columns, and the best two of each row and of
// each column.
//
// Layout of both sides: descriptors in groups of `lanes`; a group is num_chunks x lanes words, a word being
// four consecutive 8-bit values of one (permuted) descriptor.  So a vector load yields one chunk of `lanes`
// columns, and the same words, broadcast one by one, serve as rows.
//
// A result is a key: dot << index_bits | (2^index_bits - 1 - index within the block).  The largest key is the
// largest product with the smallest index, and two maxima and a minimum keep the best two.  0 means none; the
// caller makes sure that indices stay below 2^index_bits - 1 and dot products below 2^(key bits
// - index_bits).
struct BestTwoSweep {
  const uint32_t* rows = nullptr;  // num_row_groups x num_chunks x lanes, values less the kernel's row offset
  const uint32_t* columns = nullptr;  // num_column_groups x num_chunks x lanes
  // What a kernel with a row offset starts its sums from, to compensate for the offset: num_column_groups x
  // bias words x lanes.
  const uint32_t* bias = nullptr;
  // Subtracted from the products of a row, and of a column: what makes them products of values less the
  // space's offset, and none negative.  Null where the offset is 0 and there are kNumSiftChunks chunks.
  const uint32_t* row_terms = nullptr;     // rows
  const uint32_t* column_terms = nullptr;  // num_column_groups x lanes
  int num_chunks = 0;
  int num_row_groups = 0;
  int num_column_groups = 0;
  int index_bits = 0;
  uint32_t* row_states = nullptr;   // scratch: rows x 2 x lanes
  uint32_t* row_keys = nullptr;     // out: rows x (best, second)
  uint32_t* column_keys = nullptr;  // out: num_column_groups x (best, second) x lanes
};

// How a kernel wants its input.
struct BestTwoKernel {
  void (*sweep)(const BestTwoSweep&);
  int lanes;
  int row_offset;  // subtracted from the values of rows
  int num_bias;    // words of bias per column
  int key_bits;    // of a 32-bit key that it can compare
};

inline constexpr int kNumSiftChunks = 32;
inline constexpr int kMaxChunks = 256;
// Chunks whose products the kernels for small values, of SIFT alone, sum in 16 bits.
inline constexpr int kBestTwoPartialChunks = 8;

// For descriptors for which every sum of 16 products in one 16-bit lane is exact: see FitsIn16Bits.
extern const BestTwoKernel kBestTwoPortableSmall;
extern const BestTwoKernel kBestTwoAvx2Small;
// For all descriptors.
extern const BestTwoKernel kBestTwoPortable;
extern const BestTwoKernel kBestTwoAvx2;
extern const BestTwoKernel kBestTwoAvxVnni;
extern const BestTwoKernel kBestTwoAvx512Vnni;
extern const BestTwoKernel kBestTwoAmx;
extern const BestTwoKernel kBestTwoNeonDot;

}  // namespace cairn
