#pragma once

// SIFT [Lowe04]: keypoints and RootSIFT descriptors of an image or of a part of it.
//
// The keypoints are OpenCV 4.6's (features2d, SIFT) within the rounding of its float arithmetic: the image is
// doubled (unless SiftSearch says otherwise), octaves have 3 layers, level 0 has a sigma of 1.6 px, 5 pixels
// of each octave's border have no keypoints.  Unlike OpenCV's, the result has the same bits on every
// processor: see sift_kernels.h.

#include <array>
#include <functional>
#include <limits>

#include <opencv2/core/mat.hpp>

#include "core/base/pooled.h"
#include "core/sift/choose_kernels.h"

namespace cairn {

struct SiftSearch {
  // Most features; the strongest are kept.  REQUIRES: >= 1
  int max_num_features = std::numeric_limits<int>::max();
  // Least contrast, grey levels / 255, times the layers; largest ratio of principal curvatures.
  double contrast_threshold = 0.02;
  double edge_threshold = 10;
  // Whether octave 0 has pixels half as wide as the image's (Lowe's doubled image).  If not, it has the
  // image's own, in half of the time.  Of its keypoints six in ten are then the same within half a pixel, of
  // the later octaves' more than four in five; as many show a map's landmarks (bench/runtime).
  bool doubled = true;
  // Octaves that are searched, [first, end): of features with a sigma from 0.9 2^octave px to twice that.
  int first_octave = 0;
  int end_octave = std::numeric_limits<int>::max();
  // Pixels of the image whose features are wanted; empty: all.
  cv::Rect region;
  // If given: whether a feature at such a place is wanted; the others get no orientation and no descriptor,
  // which take half of the time.  x, y and size as in SiftFeature.  REQUIRES: does not call FindSift
  std::function<bool(float x, float y, float size)> is_wanted;
};

// A keypoint as OpenCV states it: the centre of the first pixel at (0, 0), a quarter pixel too much
// (KeypointFromOpenCv), twice sigma, degrees clockwise.
struct SiftFeature {
  float x = 0;
  float y = 0;
  float size = 0;
  float angle_deg = 0;
  float response = 0;  // contrast, grey levels / 255
  int octave = 0;
  std::array<uint8_t, kSiftDim> root_sift{};  // round(512 sqrt(v / |v|_1)), at most 255
  friend bool operator==(const SiftFeature&, const SiftFeature&) = default;
};

// Features of an 8-bit grey image of at least 6 x 6 px, ordered by (y, x, size, angle).  Those at zero pixels
// of `mask`, if it is not empty, are dropped before the strongest are chosen.
//
// Features of a region are, bit for bit, those of the whole image whose position is in the region, of which
// the strongest are kept.  Their support, which is all that is computed: 60 pixels of the octave around where
// they are sought (8 pixels around the region), in its level 0, and 20 more pixels of each octave before; in
// all at most 44 x 2^octave pixels of the image around the region; 76 in octave 0 of an image that is not
// doubled.
//
// Takes about 75 bytes of memory for each pixel computed; a thread keeps up to 64 MiB of them for its next
// image.  Throws: bad_alloc.
PooledVector<SiftFeature> FindSift(const cv::Mat& grey, const cv::Mat& mask, const SiftSearch& search,
                                   const SiftKernels& kernels = BestSiftKernels());

}  // namespace cairn
