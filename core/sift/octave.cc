#include "core/sift/octave.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/base/pooled.h"
#include "core/sift/gaussian.h"
#include "core/sift/refine_extremum.h"

namespace cairn {
namespace {

// The image's own blur, sigma 0.5 px, which is 1 px of the doubled image [Lowe04 §3.3].
constexpr double kSquaredDoubledSigma = 1.0;
// Doubling adds its own, that of linear interpolation a quarter pixel off: less is taken for the image's own
// where it is not doubled, so that levels are as blurred as those of the doubled image.
constexpr double kSquaredImageSigma = 0.25 - 0.25 * 0.75;
constexpr double kSquaredLevelRatio = 1.5874010519681994748;  // 2^(2 / kSiftLayers)

// Radii of the Gaussians that lead to each level: 4 sigma, rounded as OpenCV rounds the whole width.  To
// level 0 from the doubled image, to level 0 from the image, and with sigmas that are half as large.
constexpr std::array<int, kSiftLevels> kRadii = {5, 5, 6, 8, 10, 13};
constexpr int kRadiusFromImage = 7;
constexpr std::array<int, kSiftLevels> kHalvedRadii = {3, 3, 3, 4, 5, 6};
static_assert(kRadiusFromImage + 1 == kSiftImageReach);
static_assert(kRadii[1] + kRadii[2] + kRadii[3] == kSiftLevelReach);
static_assert(kSiftLevelReach + kRadii[4] + kRadii[5] == kSiftTopReach);

// Rows kept of each level, powers of two: those that the next level and a refinement still need.  0: all.
constexpr std::array<int, kSiftLevels> kRowsKept = {64, 0, 0, 0, 64, 32};
constexpr int kImageRowsKept = 32;
constexpr int kRowMargin = 64;  // floats before the first row and behind the last that kernels may read

}  // namespace

struct OctaveBlurs {
  std::array<int, kSiftLevels> radii{};  // of the Gaussian that leads to each level
  std::array<std::array<float, kSiftMaxBlurRadius + 1>, kSiftLevels> taps{};
};

namespace {

OctaveBlurs MakeBlurs(double squared_source_sigma, double sigma, std::array<int, kSiftLevels> radii) {
  OctaveBlurs blurs{.radii = radii};
  double squared_sigma = sigma * sigma;  // of the level before
  blurs.taps[0] = GaussianTaps(squared_sigma - squared_source_sigma, radii[0]);
  for (int l = 1; l < kSiftLevels; ++l) {
    blurs.taps[l] = GaussianTaps(squared_sigma * kSquaredLevelRatio - squared_sigma, radii[l]);
    squared_sigma *= kSquaredLevelRatio;
  }
  return blurs;
}

const OctaveBlurs& BlursOf(const OctavePlan& plan) {
  static const OctaveBlurs from_doubled = MakeBlurs(kSquaredDoubledSigma, kSiftSigma, kRadii);
  if (plan.source != OctaveSource::kImage) return from_doubled;  // level 0 of another octave is not blurred
  static const OctaveBlurs from_image = [] {
    std::array<int, kSiftLevels> radii = kRadii;
    radii[0] = kRadiusFromImage;
    return MakeBlurs(kSquaredImageSigma, kSiftSigma, radii);
  }();
  if (plan.sigma == kSiftSigma) return from_image;
  static const OctaveBlurs halved = MakeBlurs(kSquaredImageSigma, kSiftSigma / 2, kHalvedRadii);
  return halved;
}

// Whole blocks, and a few floats so that rows do not fall on the same places of a cache.
int64_t StrideOf(int cols) {
  return (cols + kSiftRowBlock - 1) / kSiftRowBlock * int64_t{kSiftRowBlock} + 16;
}

int64_t NumRowsKept(const OctavePlan& plan, int level) {
  return kRowsKept[level] == 0 ? plan.window.height : kRowsKept[level];
}

// As many as a search of some rows may find, in whole cache lines.
int64_t NumCandidates(const OctavePlan& plan) { return kSiftBatchRows * StrideOf(plan.window.width); }

int MirroredRow(int y, int rows) {
  while (y < 0 || y >= rows) y = y < 0 ? -y : 2 * (rows - 1) - y;
  return y;
}

// The greatest integer not above threshold / 2 in grey levels, as OpenCV: only what is above it is an
// extremum.
float SearchThreshold(double contrast) {
  return static_cast<float>(std::floor(0.5 * contrast / kSiftLayers * 255));
}

}  // namespace

size_t Octave::NumFloats(const OctavePlan& plan) {
  int64_t rows = plan.source == OctaveSource::kOctaveBefore ? 0 : kImageRowsKept;
  for (int l = 0; l < kSiftLevels; ++l) rows += NumRowsKept(plan, l);
  const int64_t stride = StrideOf(plan.window.width);
  // A multiple of a cache line, as are its terms.
  return static_cast<size_t>(rows * stride + kSiftBatchRows * SiftPaddedStride(plan.window.width) +
                             NumCandidates(plan) * sizeof(SiftCandidate) / sizeof(float) + 2 * kRowMargin);
}

Octave::Octave(const OctavePlan& plan, float* memory, const SiftKernels& kernels)
    : plan_(plan), kernels_(kernels), stride_(StrideOf(plan.window.width)), blurs_(BlursOf(plan)) {
  float* next = memory + kRowMargin;
  for (int l = 0; l < kSiftLevels; ++l) {
    levels_[l] = {next, kRowsKept[l] == 0 ? -1 : kRowsKept[l] - 1};
    next += NumRowsKept(plan, l) * stride_;
  }
  if (plan.source != OctaveSource::kOctaveBefore) {
    image_rows_ = next;
    next += kImageRowsKept * stride_;
  }
  padded_ = next + kRowMargin;
  next = padded_ + kSiftBatchRows * SiftPaddedStride(plan.window.width);
  found_ = reinterpret_cast<SiftCandidate*>(next);
}

void Octave::BlurRows(int level, int y, int num) {
  const float* rows[2 * kSiftMaxBlurRadius + kSiftBatchRows];
  float* blurred[kSiftBatchRows];
  const int radius = blurs_.radii[level];
  for (int i = 0; i < num + 2 * radius; ++i) {
    const int from = MirroredRow(y + i - radius, plan_.window.height);
    rows[i] = level == 0 ? image_rows_ + (from % kImageRowsKept) * stride_ : Row(level - 1, from);
  }
  for (int i = 0; i < num; ++i) blurred[i] = MutableRow(level, y + i);
  kernels_.blur_rows({.rows = rows,
                      .blurred = blurred,
                      .num_rows = num,
                      .taps = blurs_.taps[level].data(),
                      .radius = radius,
                      .cols = plan_.window.width,
                      .padded = padded_});
}

void Octave::Sweep(const cv::Mat& grey, const SiftThresholds& thresholds,
                   PooledVector<SiftExtremum>* extrema) {
  const cv::Rect& window = plan_.window;
  const auto pixels = [&](int row, int x) {
    return grey.ptr<uint8_t>(std::clamp(row, 0, grey.rows - 1)) + x;
  };
  int num_read = 0;
  const auto read_row = [&](int y) {
    float* const to = image_rows_ + (y % kImageRowsKept) * stride_;
    if (plan_.source == OctaveSource::kImage) {
      const uint8_t* const from = pixels(window.y + y, window.x);
      for (int x = 0; x < window.width; ++x) to[x] = from[x];
      return;
    }
    // The window's corner is at a pixel of the image.
    const int row = (y + window.y) / 2, other = (y + window.y) % 2 == 0 ? row - 1 : row + 1;
    kernels_.double_row(pixels(row, window.x / 2), pixels(other, window.x / 2), window.width / 2, to);
  };
  SweepRows(
      [&](int y, int num) {
        const int end = std::min(window.height, y + num + blurs_.radii[0]);
        while (num_read < end) read_row(num_read++);
        BlurRows(0, y, num);
      },
      thresholds, extrema);
}

void Octave::Sweep(const Octave& before, const SiftThresholds& thresholds,
                   PooledVector<SiftExtremum>* extrema) {
  const cv::Rect& window = plan_.window;
  const int first_x = 2 * window.x - before.window().x, first_y = 2 * window.y - before.window().y;
  SweepRows(
      [&](int first, int num) {
        for (int y = first; y < first + num; ++y) {
          const float* from = before.Row(kSiftLayers, first_y + 2 * y) + first_x;
          float* to = MutableRow(0, y);
          for (int x = 0; x < window.width; ++x) to[x] = from[2 * x];
        }
      },
      thresholds, extrema);
}

void Octave::Search(int y, int num, const SiftThresholds& thresholds,
                    PooledVector<SiftCandidate>* candidates) {
  const cv::Rect sought = plan_.sought - plan_.window.tl();
  const int begin = std::max(y, sought.y), end = std::min(y + num, sought.br().y);
  if (begin >= end) return;
  SiftExtremaRows rows{.first_row = begin,
                       .num_rows = end - begin,
                       .begin = sought.x,
                       .end = sought.br().x,
                       .threshold = SearchThreshold(thresholds.contrast)};
  for (int l = 0; l < kSiftLevels; ++l) {
    for (int r = 0; r < rows.num_rows + 2; ++r) rows.levels[l][r] = Row(l, begin - 1 + r);
  }
  const int num_found = kernels_.find_extrema(rows, found_);
  candidates->insert(candidates->end(), found_, found_ + num_found);
}

template <typename FirstLevelRows>
void Octave::SweepRows(const FirstLevelRows& first_level_rows, const SiftThresholds& thresholds,
                       PooledVector<SiftExtremum>* extrema) {
  const int num_rows = plan_.window.height;
  const int top = plan_.sought.empty() ? kSiftLayers : kSiftLevels - 1;
  std::array<int, kSiftLevels> num_done{};
  PooledVector<SiftCandidate> candidates;
  for (int y = 0; y < num_rows; y += kSiftBatchRows) {
    // Rows that those of the top level need.
    std::array<int, kSiftLevels> end{};
    end[top] = std::min(num_rows, y + kSiftBatchRows);
    for (int l = top; l > 0; --l) end[l - 1] = std::min(num_rows, end[l] + blurs_.radii[l]);
    for (int l = 0; l <= top; ++l) {
      while (num_done[l] < end[l]) {
        const int num = std::min(kSiftBatchRows, end[l] - num_done[l]);
        l == 0 ? first_level_rows(num_done[0], num) : BlurRows(l, num_done[l], num);
        num_done[l] += num;
      }
    }
    if (top == kSiftLayers) continue;
    Search(y - 1, kSiftBatchRows, thresholds, &candidates);
    // Those whose refinement has all rows that it may read.
    std::erase_if(candidates, [&](const SiftCandidate& candidate) {
      if (candidate.y + kSiftMaxDrift + 1 >= end[top] && end[top] < num_rows) return false;
      for (int layer = 1; layer <= kSiftLayers; ++layer) {
        if ((candidate.layers >> (layer - 1) & 1) == 0) continue;
        if (const auto extremum = RefineExtremum(*this, layer, candidate.x, candidate.y, thresholds))
          extrema->push_back(*extremum);
      }
      return true;
    });
  }
}

int NumOctaves(cv::Size image) {
  // round(log2(side) - 2) + 1, of the doubled image's side; log2's fraction exceeds 1/2 where side^2 >
  // 2^(2k+1).
  const auto side = static_cast<uint64_t>(2 * std::min(image.width, image.height));
  const int whole = std::bit_width(side) - 1;
  return whole + (side * side > uint64_t{2} << (2 * whole) ? 1 : 0) - 1;
}

}  // namespace cairn
