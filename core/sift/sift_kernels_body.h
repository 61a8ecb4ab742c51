#pragma once

// The source of all kernels of sift_kernels.h.  Before it, CAIRN_SIFT_LANES is the number of floats of a
// register; CAIRN_SIFT_MAX and CAIRN_SIFT_MIN may be instructions for what the compiler does not find.

#include <cstring>

#include "core/sift/sift_kernels.h"

namespace cairn {
namespace {

constexpr int kLanes = CAIRN_SIFT_LANES;
using Vector = float __attribute__((vector_size(kLanes * sizeof(float))));
using Mask = int32_t __attribute__((vector_size(kLanes * sizeof(float))));

inline Vector Load(const float* p) {
  Vector v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}
inline void Store(float* p, Vector v) { std::memcpy(p, &v, sizeof(v)); }
#ifdef CAIRN_SIFT_MAX
inline Vector Max(Vector a, Vector b) { return CAIRN_SIFT_MAX(a, b); }
inline Vector Min(Vector a, Vector b) { return CAIRN_SIFT_MIN(a, b); }
#else
inline Vector Max(Vector a, Vector b) { return a > b ? a : b; }
inline Vector Min(Vector a, Vector b) { return a < b ? a : b; }
#endif

void DoubleRow(const uint8_t* nearer, const uint8_t* other, int cols, float* doubled) {
  // All values are multiples of 1/16 below 2^8: exact.
  const auto mixed = [&](int x) { return 0.75f * nearer[x] + 0.25f * other[x]; };
  doubled[0] = mixed(0);
  doubled[2 * cols - 1] = mixed(cols - 1);
  for (int x = 0; x + 1 < cols; ++x) {
    const float left = mixed(x), right = mixed(x + 1);
    doubled[2 * x + 1] = 0.75f * left + 0.25f * right;
    doubled[2 * x + 2] = 0.25f * left + 0.75f * right;
  }
}

// A sum of 2 radius + 1 products for each of a block's columns; `side(i, x)` is the sum of the two values i
// steps from the middle.  Several vectors advance together, as each sum waits for the one before.
template <typename Middle, typename Side>
inline void Convolve(const float* taps, int radius, int begin, float* to, const Middle& middle,
                     const Side& side) {
  constexpr int kVectors = kSiftRowBlock / kLanes < 8 ? kSiftRowBlock / kLanes : 8;
  for (int first = begin; first < begin + kSiftRowBlock; first += kVectors * kLanes) {
    Vector sums[kVectors];
    for (int k = 0; k < kVectors; ++k) sums[k] = taps[0] * middle(first + k * kLanes);
#pragma GCC unroll 1
    for (int i = 1; i <= radius; ++i) {
      for (int k = 0; k < kVectors; ++k) sums[k] += taps[i] * side(i, first + k * kLanes);
    }
    for (int k = 0; k < kVectors; ++k) Store(to + first + k * kLanes, sums[k]);
  }
}

// The column that stands for one beyond the border: mirrored at the border's pixel.
inline int Mirrored(int x, int cols) {
  while (x < 0 || x >= cols) x = x < 0 ? -x : 2 * (cols - 1) - x;
  return x;
}

void BlurRows(const SiftBlur& blur) {
  const int64_t stride = SiftPaddedStride(blur.cols);
  for (int x = 0; x < blur.cols; x += kSiftRowBlock) {
    for (int r = 0; r < blur.num_rows; ++r) {
      const float* const* rows = blur.rows + r + blur.radius;
      Convolve(
          blur.taps, blur.radius, x, blur.padded + r * stride + kSiftRowPadding,
          [&](int at) { return Load(rows[0] + at); },
          [&](int i, int at) { return Load(rows[-i] + at) + Load(rows[i] + at); });
    }
  }
  for (int r = 0; r < blur.num_rows; ++r) {
    float* padded = blur.padded + r * stride + kSiftRowPadding;
    for (int i = 1; i <= blur.radius; ++i) {
      padded[-i] = padded[Mirrored(-i, blur.cols)];
      padded[blur.cols - 1 + i] = padded[Mirrored(blur.cols - 1 + i, blur.cols)];
    }
    for (int x = 0; x < blur.cols; x += kSiftRowBlock) {
      Convolve(
          blur.taps, blur.radius, x, blur.blurred[r], [&](int at) { return Load(padded + at); },
          [&](int i, int at) { return Load(padded + at - i) + Load(padded + at + i); });
    }
  }
}

// Differences of a run of columns, and their extrema over rows and layers: a column has an extremum if it
// equals that of its own column and the two beside it.
constexpr int kRun = 256;
struct ExtremaRun {
  alignas(64) float differences[kSiftLayers][kRun + 2 * kLanes];
  float maxima[kSiftLayers][kRun + 2 * kLanes];
  float minima[kSiftLayers][kRun + 2 * kLanes];
  uint32_t found[kRun];
};

inline void FillRun(const SiftExtremaRows& rows, int row, int from, int at, ExtremaRun* run) {
  Vector middle[kSiftLayers + 2], most[kSiftLayers + 2], least[kSiftLayers + 2];
  Vector below[3];
  for (int r = 0; r < 3; ++r) below[r] = Load(rows.levels[0][row + r] + from);
  for (int l = 0; l < kSiftLayers + 2; ++l) {
    Vector difference[3];
    for (int r = 0; r < 3; ++r) {
      const Vector above = Load(rows.levels[l + 1][row + r] + from);
      difference[r] = above - below[r];
      below[r] = above;
    }
    middle[l] = difference[1];
    most[l] = Max(Max(difference[0], difference[1]), difference[2]);
    least[l] = Min(Min(difference[0], difference[1]), difference[2]);
  }
  for (int s = 0; s < kSiftLayers; ++s) {
    Store(run->differences[s] + at, middle[s + 1]);
    Store(run->maxima[s] + at, Max(Max(most[s], most[s + 1]), most[s + 2]));
    Store(run->minima[s] + at, Min(Min(least[s], least[s + 1]), least[s + 2]));
  }
}

inline void SearchRun(int num, float threshold, ExtremaRun* run) {
  for (int at = 0; at < num; at += kLanes) {
    Mask found{};
    for (int s = 0; s < kSiftLayers; ++s) {
      const Vector value = Load(run->differences[s] + at + kLanes);
      const float* maxima = run->maxima[s] + at + kLanes;
      const float* minima = run->minima[s] + at + kLanes;
      const Vector most = Max(Max(Load(maxima - 1), Load(maxima)), Load(maxima + 1));
      const Vector least = Min(Min(Load(minima - 1), Load(minima)), Load(minima + 1));
      const Mask is_extremum =
          ((value > threshold) & (value >= most)) | ((value < -threshold) & (value <= least));
      found |= is_extremum & (1 << s);
    }
    std::memcpy(run->found + at, &found, sizeof(found));
  }
}

int FindExtrema(const SiftExtremaRows& rows, SiftCandidate* candidates) {
  ExtremaRun run;
  int num_candidates = 0;
  // From a register's beginning: loads that lie within a cache line are twice as fast.
  for (int begin = rows.begin / kLanes * kLanes; begin < rows.end; begin += kRun) {
    const int num = rows.end - begin < kRun ? rows.end - begin : kRun;
    for (int row = 0; row < rows.num_rows; ++row) {
      // Column `begin` is at kLanes; the one before and the one after the run are read too.
      for (int at = 0; at < num + kLanes + 1; at += kLanes) FillRun(rows, row, begin - kLanes + at, at, &run);
      SearchRun(num, rows.threshold, &run);
      for (int k = 0; k < num; k += 2) {
        uint64_t pair;
        std::memcpy(&pair, run.found + k, sizeof(pair));
        if (pair == 0) continue;
        for (int at = k; at < k + 2 && at < num; ++at) {
          if (run.found[at] != 0 && begin + at >= rows.begin)
            candidates[num_candidates++] = {begin + at, rows.first_row + row, run.found[at]};
        }
      }
    }
  }
  return num_candidates;
}

// Samples of a patch are gathered row by row, and then worked on together in whole groups: what a row or a
// group lacks is filled with what is not used, but is numbers, as some of it becomes integers.
constexpr int kSampleGroup = 16;
constexpr int WholeGroups(int num) { return (num + kSampleGroup - 1) / kSampleGroup * kSampleGroup; }
constexpr int kMaxRowSamples = WholeGroups(2 * kSiftMaxPatchRadius + 1);
constexpr int kSamplesTogether = 256;
constexpr int kMaxSamples = kSamplesTogether + kMaxRowSamples;

struct Gradients {
  float dx[kMaxSamples] = {};
  float dy[kMaxSamples] = {};  // upwards
  float weights[kMaxSamples];
  float slopes[kMaxSamples];      // of the shorter and the longer of the two
  float magnitudes[kMaxSamples];  // weighted
  float directions[kMaxSamples];  // eighths of a turn, counter-clockwise, in [0, 8]
};

// The differences of `num` pixels from `row` on.
inline void GatherGradients(const float* row, int64_t stride, int num, float row_weight,
                            const float* column_weights, int at, Gradients* gradients) {
  float* __restrict dx = gradients->dx + at;
  float* __restrict dy = gradients->dy + at;
  float* __restrict weights = gradients->weights + at;
  for (int k = 0; k < WholeGroups(num); ++k) {
    dx[k] = row[k + 1] - row[k - 1];
    dy[k] = row[k - stride] - row[k + stride];
    weights[k] = row_weight * column_weights[k];
  }
}

// In two loops: in one, the compiler computes both sides of what is decided, with two divisions.
inline void FindGradients(int num, Gradients* __restrict gradients) {
  for (int k = 0; k < WholeGroups(num); ++k) {
    const float dx = gradients->dx[k], dy = gradients->dy[k];
    gradients->magnitudes[k] = gradients->weights[k] * __builtin_sqrtf(dx * dx + dy * dy);
    const float width = __builtin_fabsf(dx), height = __builtin_fabsf(dy);
    const float shorter = width < height ? width : height, longer = width < height ? height : width;
    gradients->slopes[k] = shorter / (longer + 1e-30f);  // 0 if both are
  }
  for (int k = 0; k < WholeGroups(num); ++k) {
    // [Abramowitz & Stegun 4.4.47], error at most 1e-5 rad; its coefficients over pi / 4.
    const float dx = gradients->dx[k], dy = gradients->dy[k], t = gradients->slopes[k], t2 = t * t;
    float angle =
        ((((0.02652807f * t2 - 0.10839470f) * t2 + 0.22936264f) * t2 - 0.42055039f) * t2 + 1.27306893f) * t;
    angle = __builtin_fabsf(dx) < __builtin_fabsf(dy) ? 2.0f - angle : angle;
    angle = dx < 0 ? 4.0f - angle : angle;
    gradients->directions[k] = dy < 0 ? 8.0f - angle : angle;
  }
}

// The weights of columns from -radius, with as many zeros as a last group may need.
struct ColumnWeights {
  explicit ColumnWeights(const SiftPatch& patch) : middle(values + patch.radius) {
    for (int j = 0; j <= patch.radius; ++j)
      values[patch.radius - j] = values[patch.radius + j] = patch.weights[j];
  }
  float values[kMaxRowSamples + kSampleGroup] = {};
  const float* middle;
};

// Columns of a row of the patch, from its middle.
struct Interval {
  int begin = 0;
  int end = 0;
};

// Calls work(num) for all samples, some rows together.  `columns_of(i)` are those of row i that are in the
// level; `gather(i, columns, at)` puts them behind the `at` that are there already.
template <typename ColumnsOf, typename Gather, typename Work>
inline void WorkOnSamples(const SiftPatch& patch, const ColumnsOf& columns_of, const Gather& gather,
                          const Work& work) {
  int num = 0;
  for (int i = -patch.radius; i <= patch.radius; ++i) {
    const int y = patch.y + i;
    if (y < 1 || y > patch.rows - 2) continue;
    Interval columns = columns_of(i);
    if (columns.begin < 1 - patch.x) columns.begin = 1 - patch.x;
    if (columns.end > patch.cols - 1 - patch.x) columns.end = patch.cols - 1 - patch.x;
    if (columns.begin >= columns.end) continue;
    gather(i, columns, num);
    num += columns.end - columns.begin;
    if (num < kSamplesTogether) continue;
    work(num);
    num = 0;
  }
  work(num);
}

void OrientationHistogram(const SiftPatch& patch, float* histogram) {
  // Neighbours often have one direction: several sums for each, so that one need not wait for the other.
  float sums[4][kSiftDirections + 1] = {};
  Gradients gradients;
  int32_t bins[kMaxSamples];
  const ColumnWeights weights(patch);
  WorkOnSamples(
      patch,
      [&](int) {
        return Interval{-patch.radius, patch.radius + 1};
      },
      [&](int i, const Interval& columns, int at) {
        GatherGradients(patch.level + (patch.y + i) * patch.stride + patch.x + columns.begin, patch.stride,
                        columns.end - columns.begin, weights.middle[i], weights.middle + columns.begin, at,
                        &gradients);
      },
      [&](int num) {
        FindGradients(num, &gradients);
        for (int k = 0; k < WholeGroups(num); ++k)
          bins[k] = static_cast<int32_t>(gradients.directions[k] * (kSiftDirections / 8.0f) + 0.5f);
        for (int k = 0; k < num; ++k) sums[k & 3][bins[k]] += gradients.magnitudes[k];
      });
  const auto sum = [&](int b) { return (sums[0][b] + sums[1][b]) + (sums[2][b] + sums[3][b]); };
  for (int b = 0; b < kSiftDirections; ++b) histogram[b] = sum(b);
  histogram[0] += sum(kSiftDirections);
}

// A histogram of the descriptor with a ring of cells around it, which takes what falls outside.
constexpr int kRingCells = kSiftCells + 2;
using Directions = float __attribute__((vector_size(kSiftCellDirections * sizeof(float))));

// Where in the histogram samples are, and what they add to the cells there.
struct Samples {
  float rows[kMaxSamples] = {};  // cells, the ring included
  float columns[kMaxSamples] = {};
  int32_t cells[kMaxSamples];
  float values[4][kMaxSamples];  // to the cell, the one to its right, and the two below
  int32_t directions[kMaxSamples];
  float direction_fractions[kMaxSamples];
};

// The largest float below kSiftCells + 1.
constexpr float kLastPlace = 4.9999995f;

// 0, 1, ..., one for each lane.
inline Vector Steps() {
  Vector steps;
  for (int lane = 0; lane < kLanes; ++lane) steps[lane] = static_cast<float>(lane);
  return steps;
}

// Places of a row's samples; those outside get no weight.
inline void GatherPlaces(const SiftPatch& patch, int i, const Interval& columns, int at, Samples* samples,
                         Gradients* gradients) {
  constexpr float kMiddle = kSiftCells / 2 + 0.5f;  // the keypoint's place
  const float row_sine = static_cast<float>(i) * patch.sine,
              row_cosine = static_cast<float>(i) * patch.cosine;
  const float sine = patch.sine, cosine = patch.cosine;
  const Vector steps = Steps();
  float* weights = gradients->weights + at;
  const int begin = columns.begin, num = WholeGroups(columns.end - columns.begin);
  for (int k = 0; k < num; k += kLanes) {
    const Vector j = static_cast<float>(begin + k) + steps;
    const Vector column = j * cosine - row_sine + kMiddle;
    const Vector row = j * sine + row_cosine + kMiddle;
    Store(samples->rows + at + k, Min(Max(row, Vector{}), Vector{} + kLastPlace));
    Store(samples->columns + at + k, Min(Max(column, Vector{}), Vector{} + kLastPlace));
    const Mask inside = (row > 0) & (row < kSiftCells + 1) & (column > 0) & (column < kSiftCells + 1);
    Store(weights + k, inside ? Load(weights + k) : Vector{});
  }
}

inline void PlaceSamples(const Gradients& gradients, float orientation, int num,
                         Samples* __restrict samples) {
  for (int k = 0; k < WholeGroups(num); ++k) {
    const float row = samples->rows[k], column = samples->columns[k];
    const auto row_cell = static_cast<int32_t>(row), column_cell = static_cast<int32_t>(column);
    samples->cells[k] = row_cell * kRingCells + column_cell;
    const float column_fraction = column - static_cast<float>(column_cell);
    const float value = gradients.magnitudes[k];
    const float lower = value * (row - static_cast<float>(row_cell)), upper = value - lower;
    const float upper_right = upper * column_fraction, lower_right = lower * column_fraction;
    samples->values[0][k] = upper - upper_right;
    samples->values[1][k] = upper_right;
    samples->values[2][k] = lower - lower_right;
    samples->values[3][k] = lower_right;
    const float turn = gradients.directions[k] - orientation;
    const float direction = turn < 0 ? turn + kSiftCellDirections : turn;
    const auto whole = static_cast<int32_t>(direction);
    samples->directions[k] = whole;
    samples->direction_fractions[k] = direction - static_cast<float>(whole);
  }
}

// One for each direction, twice, as the last is followed by the first.
constexpr Directions kUnit[kSiftCellDirections + 2] = {
    {1, 0, 0, 0, 0, 0, 0, 0}, {0, 1, 0, 0, 0, 0, 0, 0}, {0, 0, 1, 0, 0, 0, 0, 0}, {0, 0, 0, 1, 0, 0, 0, 0},
    {0, 0, 0, 0, 1, 0, 0, 0}, {0, 0, 0, 0, 0, 1, 0, 0}, {0, 0, 0, 0, 0, 0, 1, 0}, {0, 0, 0, 0, 0, 0, 0, 1},
    {1, 0, 0, 0, 0, 0, 0, 0}, {0, 1, 0, 0, 0, 0, 0, 0}};

// Adds a sample to the four nearest cells and, in each, to the two nearest directions [Lowe04 §6.1].
inline void AddSample(const Samples& samples, int k, Directions* histogram) {
  const float fraction = samples.direction_fractions[k];
  const Directions* unit = kUnit + samples.directions[k];
  const Directions weights = unit[0] * (1.0f - fraction) + unit[1] * fraction;
  Directions* cell = histogram + samples.cells[k];
  cell[0] += weights * samples.values[0][k];
  cell[1] += weights * samples.values[1][k];
  cell[kRingCells] += weights * samples.values[2][k];
  cell[kRingCells + 1] += weights * samples.values[3][k];
}

// Columns j with |slope j + offset| < 2.5, that half of a descriptor, and up to a pixel of slack.
inline void ClipToBand(float slope, float offset, float* least, float* most) {
  constexpr float kHalf = (kSiftCells + 1) / 2.0f;
  if (slope < 0) {
    slope = -slope;
    offset = -offset;
  }
  if (slope < 1e-6f) return;  // parallel; PlaceSamples decides
  const float from = (-kHalf - offset) / slope, to = (kHalf - offset) / slope;
  *least = *least > from ? *least : from;
  *most = *most < to ? *most : to;
}
inline Interval ColumnsInSquare(const SiftPatch& patch, int i) {
  float least = static_cast<float>(-patch.radius), most = static_cast<float>(patch.radius);
  const auto row = static_cast<float>(i);
  ClipToBand(patch.cosine, -row * patch.sine, &least, &most);
  ClipToBand(patch.sine, row * patch.cosine, &least, &most);
  if (!(least <= most)) return {};
  // Rounded outwards.
  const int begin = static_cast<int>(least) - (least < 0), end = static_cast<int>(most) + (most > 0) + 1;
  return {begin < -patch.radius ? -patch.radius : begin, end > patch.radius + 1 ? patch.radius + 1 : end};
}

// [Lowe04 §6.1]: normalised, values above 0.2 cut, normalised again and rounded to 8 bits, as OpenCV does;
// then RootSIFT [Arandjelovic & Zisserman 2012], quantised as COLMAP's FeatureDescriptorsToUnsignedByte.
inline float SquaredNorm(const float* values) {
  float sums[kSiftCellDirections] = {};
  for (int c = 0; c < kSiftDim; c += kSiftCellDirections) {
    for (int k = 0; k < kSiftCellDirections; ++k) sums[k] += values[c + k] * values[c + k];
  }
  return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}
void Quantise(float* values, uint8_t* root_sift) {
  const float most = __builtin_sqrtf(SquaredNorm(values)) * 0.2f;
  for (int d = 0; d < kSiftDim; ++d) values[d] = values[d] < most ? values[d] : most;
  const float norm = __builtin_sqrtf(SquaredNorm(values));
  const float scale = 512.0f / (norm > 1e-7f ? norm : 1e-7f);
  int32_t l1 = 0;
  for (int d = 0; d < kSiftDim; ++d) {
    constexpr float kRounding = 12582912.0f;  // 1.5 x 2^23: its last bit is 1, so the sum is rounded to even
    const float rounded = values[d] * scale + kRounding - kRounding;
    values[d] = rounded < 255.0f ? rounded : 255.0f;
    l1 += static_cast<int32_t>(values[d]);
  }
  const float share = l1 > 0 ? 1.0f / static_cast<float>(l1) : 0.0f;
  for (int d = 0; d < kSiftDim; ++d) {
    const float root = 512.0f * __builtin_sqrtf(values[d] * share) + 0.5f;
    root_sift[d] = static_cast<uint8_t>(static_cast<int32_t>(root < 255.0f ? root : 255.0f));
  }
}

void Describe(const SiftPatch& patch, uint8_t* root_sift) {
  // Neighbours share cells: several histograms in turn, so that a sum need not wait for the one before.
  constexpr int kNumCells = kRingCells * kRingCells;
  Directions histograms[4][kNumCells] = {};
  Gradients gradients;
  Samples samples;
  const ColumnWeights weights(patch);
  WorkOnSamples(
      patch, [&](int i) { return ColumnsInSquare(patch, i); },
      [&](int i, const Interval& columns, int at) {
        GatherGradients(patch.level + (patch.y + i) * patch.stride + patch.x + columns.begin, patch.stride,
                        columns.end - columns.begin, weights.middle[i], weights.middle + columns.begin, at,
                        &gradients);
        GatherPlaces(patch, i, columns, at, &samples, &gradients);
      },
      [&](int num) {
        FindGradients(num, &gradients);
        PlaceSamples(gradients, patch.orientation, num, &samples);
        int k = 0;
        for (; k + 4 <= num; k += 4) {
          for (int h = 0; h < 4; ++h) AddSample(samples, k + h, histograms[h]);
        }
        for (; k < num; ++k) AddSample(samples, k, histograms[k & 3]);
      });
  float values[kSiftDim];
  for (int row = 0; row < kSiftCells; ++row) {
    for (int column = 0; column < kSiftCells; ++column) {
      const int cell = (row + 1) * kRingCells + column + 1;
      const Directions sum =
          (histograms[0][cell] + histograms[1][cell]) + (histograms[2][cell] + histograms[3][cell]);
      std::memcpy(values + (row * kSiftCells + column) * kSiftCellDirections, &sum, sizeof(sum));
    }
  }
  Quantise(values, root_sift);
}

}  // namespace
}  // namespace cairn

#define CAIRN_SIFT_KERNELS(name) \
  { name, DoubleRow, BlurRows, FindExtrema, OrientationHistogram, Describe }
