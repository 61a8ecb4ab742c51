#pragma once

// The inner loops of SIFT, one table of functions per instruction set.  All are compiled from one source
// (sift_kernels_body.h) with that set's flags.  Each element's operations and their order are the source's:
// no sum depends on the number of lanes, no product is fused with a sum, and there is no library function but
// the square root, which IEEE 754 rounds exactly.  So all sets give the same bits.
//
// Nothing here may instantiate code that other files share (no standard containers).

#include <cstdint>

namespace cairn {

// Of an octave [Lowe04 §3.2]: layers in which extrema are sought, and Gaussian levels, two of which bound
// each of the layers + 2 differences.
inline constexpr int kSiftLayers = 3;
inline constexpr int kSiftLevels = kSiftLayers + 3;

// Largest radius of a Gaussian: four times the largest standard deviation between two levels, 3.09 px.
inline constexpr int kSiftMaxBlurRadius = 13;
// Rows are read and written in whole blocks of so many floats.
inline constexpr int kSiftRowBlock = 64;
// Floats beside a row of `SiftBlur::padded`.
inline constexpr int kSiftRowPadding = 16;

// Directions of the histogram that yields a keypoint's orientation [Lowe04 §5].
inline constexpr int kSiftDirections = 36;
// A descriptor has 4 x 4 cells of 8 directions [Lowe04 §6.1].
inline constexpr int kSiftCells = 4;
inline constexpr int kSiftCellDirections = 8;
inline constexpr int kSiftDim = kSiftCells * kSiftCells * kSiftCellDirections;
// Largest radius of a descriptor's samples in its octave: 2.5 sqrt(2) cells of 3 sigma, sigma < 3.6 px.
inline constexpr int kSiftMaxPatchRadius = 39;

// Rows of a level from those of the level before: the columns' Gaussian, then the rows'.  Several at once, as
// they share what they are computed from, which then stays in the nearest cache.
struct SiftBlur {
  const float* const* rows = nullptr;  // num_rows + 2 radius: the first row's neighbours, ..., the last one's
  float* const* blurred = nullptr;     // out: num_rows, whole blocks of columns
  int num_rows = 0;                    // at most kSiftBatchRows
  const float* taps = nullptr;         // radius + 1: the Gaussian's middle value, then those beside it
  int radius = 0;
  int cols = 0;
  float* padded = nullptr;  // scratch: kSiftBatchRows rows of SiftPaddedStride(cols)
};
inline constexpr int kSiftBatchRows = 8;
static constexpr int64_t SiftPaddedStride(int cols) {
  return (cols + kSiftRowBlock - 1) / kSiftRowBlock * int64_t{kSiftRowBlock} + 2 * kSiftRowPadding;
}

// Pixels of some rows that are extrema among their 26 neighbours [Lowe04 §3.1].
struct SiftCandidate {
  int32_t x = 0;
  int32_t y = 0;
  uint32_t layers = 0;  // bit s is set where layer s + 1 has an extremum
  friend bool operator==(const SiftCandidate&, const SiftCandidate&) = default;
};
struct SiftExtremaRows {
  const float* levels[kSiftLevels][kSiftBatchRows + 2] =
      {};  // the row above the first, ..., that below the last
  int first_row = 0;
  int num_rows = 0;  // at most kSiftBatchRows
  int begin = 0;     // columns, with one more to either side that can be read
  int end = 0;
  float threshold = 0;  // least absolute value, exclusive
};

// The part of a level around a keypoint.
struct SiftPatch {
  const float* level = nullptr;  // its pixel (0, 0)
  int64_t stride = 0;
  int cols = 0;
  int rows = 0;
  int x = 0;  // the keypoint's pixel
  int y = 0;
  int radius = 0;
  // radius + 1 values of a Gaussian: a sample's weight is the product of its row's and its column's.  Up to
  // 16 floats behind a row's last sample are read, but not used.
  const float* weights = nullptr;
  // Of a descriptor: the orientation's cosine and sine over the width of a cell, the orientation in eighths
  // of a turn.
  float cosine = 0;
  float sine = 0;
  float orientation = 0;
};

struct SiftKernels {
  const char* name;
  // A row of the doubled image: 3/4 of the nearer row and 1/4 of the other one, and so for columns.
  void (*double_row)(const uint8_t* nearer, const uint8_t* other, int cols, float* doubled);
  void (*blur_rows)(const SiftBlur& blur);
  // Appends to `found`, which has room for all pixels of the rows; returns their number.
  int (*find_extrema)(const SiftExtremaRows& rows, SiftCandidate* found);
  // Adds up the weighted gradients by direction, counter-clockwise with y upwards, into kSiftDirections
  // values.
  void (*orientation_histogram)(const SiftPatch& patch, float* histogram);
  // kSiftDim values: RootSIFT of the descriptor, quantised.
  void (*describe)(const SiftPatch& patch, uint8_t* root_sift);
};

extern const SiftKernels kSiftPortable;
extern const SiftKernels kSiftAvx2;
extern const SiftKernels kSiftAvx512;
extern const SiftKernels kSiftNeon;

}  // namespace cairn
