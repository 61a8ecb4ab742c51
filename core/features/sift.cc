#include "core/features/sift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/base/pooled.h"
#include "core/features/smaller_image.h"
#include "core/sift/find_sift.h"

namespace cairn {
namespace {

// No keypoint is in the 5 pixels at the border of the doubled image.
constexpr int kMinImageSide = 6;
static_assert(kSiftDim == kSiftDescriptorDim);

// Least scale of octave 1: half a layer above its level 0.
constexpr double kOctaveOneScalePx = 1.7959392773;  // 1.6 * 2^(1/6)

// The largest grey level than which a tenth of the pixels are not darker.
int BrightLevel(const cv::Mat& grey, const cv::Mat& mask) {
  constexpr int kRowStep = 4;  // the others are like them
  std::array<int, 256> num_of_level{};
  int64_t num = 0;
  for (int y = 0; y < grey.rows; y += kRowStep) {
    const uint8_t* const levels = grey.ptr<uint8_t>(y);
    const uint8_t* const is_seen = mask.empty() ? nullptr : mask.ptr<uint8_t>(y);
    for (int x = 0; x < grey.cols; ++x) {
      if (is_seen != nullptr && is_seen[x] == 0) continue;
      ++num_of_level[levels[x]];
      ++num;
    }
  }
  int level = 255;
  for (int64_t num_above = num_of_level[level]; level > 0 && num_above * 10 < num;)
    num_above += num_of_level[--level];
  return level;
}

// What part of a contrast is left in a dark image, one whose brightest tenth, which a lamp or two are not, is
// dark: less than in proportion, as an image in which that begins at kDarkLevel is no bright one.  A black
// one shows nothing but noise, of which a search would make features.
double ContrastLeft(const cv::Mat& grey, const cv::Mat& mask) {
  constexpr int kDarkLevel = 80, kBlackLevel = 5;
  constexpr double kLeast = 0.1;
  const int level = BrightLevel(grey, mask);
  if (level >= kDarkLevel || level < kBlackLevel) return 1;
  return std::max(kLeast, level * level / double{kDarkLevel * kDarkLevel});
}

using IsWanted = std::function<bool(const Keypoint&)>;

// `search`: which octaves, of the doubled image or not.
Features Extract(const cv::Mat& grey, const SiftOptions& options, const cv::Mat& mask, SiftSearch search,
                 const IsWanted& is_wanted) {
  Features features;
  features.descriptors.resize(0, kSiftDescriptorDim);
  if (std::min(grey.cols, grey.rows) < kMinImageSide) return features;
  search.max_num_features = options.max_num_features;
  search.contrast_threshold = options.contrast_threshold * ContrastLeft(grey, mask);
  search.edge_threshold = options.edge_threshold;
  if (is_wanted) {
    search.is_wanted = [&is_wanted](float x, float y, float size) {
      return is_wanted(KeypointFromOpenCv(x, y, size, 0));
    };
  }
  const PooledVector<SiftFeature> found = FindSift(grey, mask, search);
  features.descriptors.resize(static_cast<Eigen::Index>(found.size()), kSiftDescriptorDim);
  features.keypoints.reserve(found.size());
  for (const SiftFeature& feature : found) {
    std::copy(feature.root_sift.begin(), feature.root_sift.end(),
              features.descriptors.row(static_cast<Eigen::Index>(features.keypoints.size())).data());
    features.keypoints.push_back(KeypointFromOpenCv(feature.x, feature.y, feature.size, feature.angle_deg));
  }
  return features;
}

// The same of an image that is made smaller where it is too large, in the pixels of the whole one.
Features ExtractFromSmaller(const cv::Mat& grey, const SiftOptions& options, const cv::Mat& mask,
                            const SiftSearch& search, const IsWanted& is_wanted) {
  const std::optional<SmallerImage> smaller = MakeSmaller(grey, mask, options.max_image_side_px);
  if (!smaller) return Extract(grey, options, mask, search, is_wanted);
  IsWanted is_small_wanted;
  if (is_wanted)
    is_small_wanted = [&](const Keypoint& keypoint) { return is_wanted(smaller->Larger(keypoint)); };
  Features features = Extract(smaller->grey, options, smaller->mask, search, is_small_wanted);
  for (Keypoint& keypoint : features.keypoints) keypoint = smaller->Larger(keypoint);
  return features;
}

}  // namespace

OptionTable DescribeOptions(SiftOptions* options) {
  return {{.name = "max_num_features",
           .value = &options->max_num_features,
           .help = "most features per image; the strongest are kept",
           .min = 1,
           .max = 1000000},
          {.name = "max_image_side_px",
           .value = &options->max_image_side_px,
           .help = "images with a longer side are made smaller before features are sought, pixels",
           .min = 64,
           .max = 65536},
          {.name = "contrast_threshold",
           .value = &options->contrast_threshold,
           .help = "least contrast of an extremum, grey levels / 255; less in dark images",
           .min = 0,
           .max = 1},
          {.name = "edge_threshold",
           .value = &options->edge_threshold,
           .help = "largest ratio of principal curvatures, which rejects points on edges",
           .min = 1}};
}

Keypoint KeypointFromOpenCv(float x, float y, float size, float angle_deg) {
  // OpenCV puts the centre of the first pixel at (0, 0).  Its SIFT finds extrema in the doubled image, whose
  // pixel (i, j) it takes for (i / 2, j / 2) of the original, although resizing puts it at ((i - 0.5) / 2, (j
  // - 0.5) / 2): a quarter pixel too much.  Its size is a diameter, twice sigma; its angle is in degrees,
  // clockwise in the image as COLMAP's.
  constexpr float kCentreOffset = 0.5f;
  constexpr float kDoublingOffset = 0.25f;
  const float rad = angle_deg * static_cast<float>(M_PI / 180.0);
  return {x + kCentreOffset - kDoublingOffset, y + kCentreOffset - kDoublingOffset, 0.5f * size, rad};
}

Result<Features> ExtractSift(const cv::Mat& grey, const SiftOptions& options, const cv::Mat& mask) {
  CAIRN_RETURN_IF_ERROR(CheckGreyImage(grey, "SIFT"));
  CAIRN_RETURN_IF_ERROR(CheckMask(mask, grey));
  return ExtractFromSmaller(grey, options, mask, {}, {});
}

int64_t NumSiftPixels(cv::Size image, const SiftOptions& options) {
  const double ratio = SmallerRatio(image, options.max_image_side_px);
  return std::llround(ratio * ratio * image.width * image.height);
}

double CoarseSiftScalePx(cv::Size image, const SiftOptions& options) {
  return kOctaveOneScalePx / SmallerRatio(image, options.max_image_side_px);
}

Result<Features> ExtractUndoubledSift(const cv::Mat& grey, const SiftOptions& options, SiftScales scales,
                                      const std::function<bool(const Keypoint&)>& is_wanted) {
  CAIRN_RETURN_IF_ERROR(CheckGreyImage(grey, "SIFT"));
  SiftSearch search{.doubled = false};
  if (scales == SiftScales::kCoarse) search.first_octave = 1;
  if (scales == SiftScales::kFine) search.end_octave = 1;
  return ExtractFromSmaller(grey, options, {}, search, is_wanted);
}

}  // namespace cairn
