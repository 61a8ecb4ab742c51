#pragma once

#include <array>

#include <opencv2/core/mat.hpp>

#include "core/base/pooled.h"
#include "core/sift/sift_kernels.h"

namespace cairn {

inline constexpr double kSiftSigma = 1.6;  // of level 0, pixels of the octave [Lowe04 §3.3]

// What the first level of an octave is blurred from.
enum class OctaveSource { kDoubledImage, kImage, kOctaveBefore };

// What of an octave is computed, in its own pixels.  Octave o finds features of sigma 2^o to 2^(o + 1) times
// 0.9 px of the image.
struct OctavePlan {
  int octave = 0;
  OctaveSource source = OctaveSource::kDoubledImage;
  float pixel = 0.5f;         // its pixels' width, pixels of the image
  double sigma = kSiftSigma;  // of level 0, its pixels
  cv::Size size;              // of the whole octave
  cv::Rect window;            // whose levels are computed
  cv::Rect sought;            // where extrema are sought; empty: only the next octave's beginning is wanted
};

struct SiftThresholds {
  double contrast = 0;  // least of an extremum, grey levels / 255 [Lowe04 §4]
  double edge = 0;      // largest ratio of principal curvatures [Lowe04 §4.1]
};

// A keypoint without its orientation.
struct SiftExtremum {
  int octave = 0;
  int layer = 0;  // 1..kSiftLayers
  int x = 0;      // its pixel in the octave
  int y = 0;
  float octave_x = 0;  // refined, in the octave's pixels
  float octave_y = 0;
  float octave_sigma = 0;  // in the octave's pixels
  float response = 0;      // absolute value of the difference of Gaussians there, grey levels / 255
};

struct OctaveBlurs;  // octave.cc

// The Gaussian levels of a window of one octave.  Levels 1 to kSiftLayers, from which keypoints are
// described, have all their rows; the others the last few.
class Octave {
 public:
  // Floats that the octave needs, in whole cache lines.
  static size_t NumFloats(const OctavePlan& plan);

  // REQUIRES: `memory` begins with a cache line, and all its values are finite
  Octave(const OctavePlan& plan, float* memory, const SiftKernels& kernels);

  // Computes the levels from the image or from the octave before, which has to be computed, and appends the
  // extrema sought.  Rows of all levels advance together, so that they are read from a near
  // cache.
  void Sweep(const cv::Mat& grey, const SiftThresholds& thresholds, PooledVector<SiftExtremum>* extrema);
  void Sweep(const Octave& before, const SiftThresholds& thresholds, PooledVector<SiftExtremum>* extrema);

  const OctavePlan& plan() const { return plan_; }
  const cv::Rect& window() const { return plan_.window; }
  int64_t stride() const { return stride_; }
  // A row of a level, both counted from the window's corner.
  const float* Row(int level, int y) const {
    return levels_[level].first + (y & levels_[level].mask) * stride_;
  }
  // Difference of Gaussians.
  float Difference(int layer, int x, int y) const { return Row(layer + 1, y)[x] - Row(layer, y)[x]; }

 private:
  struct Level {
    float* first = nullptr;
    int mask = -1;  // of a row's number: where its place is among those kept
  };
  template <typename FirstLevelRows>
  void SweepRows(const FirstLevelRows& first_level_rows, const SiftThresholds& thresholds,
                 PooledVector<SiftExtremum>* extrema);
  void BlurRows(int level, int y, int num);
  void Search(int y, int num, const SiftThresholds& thresholds, PooledVector<SiftCandidate>* candidates);
  float* MutableRow(int level, int y) { return levels_[level].first + (y & levels_[level].mask) * stride_; }

  OctavePlan plan_;
  const SiftKernels& kernels_;
  int64_t stride_ = 0;
  std::array<Level, kSiftLevels> levels_;
  const OctaveBlurs& blurs_;
  float* image_rows_ = nullptr;  // of the image, or of the doubled image, where the octave is made of it
  float* padded_ = nullptr;
  SiftCandidate* found_ = nullptr;  // scratch
};

// Octaves of an image: those of the doubled image whose smaller side is at least about 6 px, as OpenCV's.
int NumOctaves(cv::Size image);

// How far a refinement may lead from the pixel where it begins.
inline constexpr int kSiftMaxDrift = 5;
// How far a pixel of level 0 reaches in the image that it is blurred from, with the pixel that doubling adds.
inline constexpr int kSiftImageReach = 8;
// How far a pixel of level kSiftLayers reaches in level 0, and one of the topmost.
inline constexpr int kSiftLevelReach = 5 + 6 + 8;
inline constexpr int kSiftTopReach = kSiftLevelReach + 10 + 13;
// How far an extremum that is sought reaches in level 0, with its descriptor (of gradients, around a rounded
// place) and its refinement.
inline constexpr int kSiftSearchReach = kSiftMaxPatchRadius + 2 + kSiftLevelReach;
static_assert(kSiftSearchReach >= kSiftMaxDrift + 1 + kSiftTopReach);

}  // namespace cairn
