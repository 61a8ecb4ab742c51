#include "core/work/affordable_sift.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

namespace cairn {
namespace {

// Parts of what is left that go to features: what follows makes a fix sure.
constexpr double kPart = 0.5, kMostPart = 0.75;

// Scales that may be sought, and the fewest features of them that are worth it.
struct Scales {
  Work pixel;
  std::optional<SiftScales> undoubled;  // none: those of the doubled image
  int fewest = 0;
  double most_part = kPart;  // which so many may take
  int shrink = 1;            // the image is made so many times smaller before
};

// The best first.
constexpr std::array<Scales, 5> kAll = {{{Work::kWholePixel, std::nullopt, 1000},
                                         {Work::kUndoubledPixel, SiftScales::kAll, 600},
                                         {Work::kCoarsePixel, SiftScales::kCoarse, 250},
                                         {Work::kUndoubledPixel, SiftScales::kAll, 150, kMostPart, 2},
                                         {Work::kUndoubledPixel, SiftScales::kAll, 100, kMostPart, 4}}};
constexpr std::array<Scales, 2> kCoarse = {{{Work::kCoarsePixel, SiftScales::kCoarse, 150},
                                            {Work::kUndoubledPixel, SiftScales::kAll, 100, kMostPart, 2}}};

double MinScalePx(cv::Size image, const SiftOptions& sift, const Scales& scales) {
  if (!scales.undoubled) return 0;
  const double coarse_px = CoarseSiftScalePx(image, sift);
  return *scales.undoubled == SiftScales::kCoarse ? coarse_px : 0.5 * coarse_px;
}

}  // namespace

Result<std::optional<AffordedSift>> AffordableSift(const cv::Mat& grey, const SiftOptions& options,
                                                   bool coarse, int64_t of_feature_ps, WorkBudget* work) {
  if (IsSpent(work)) return std::optional<AffordedSift>();
  of_feature_ps += WorkBudget::PicosecondsOf(Work::kFeature);
  for (const Scales& scales : coarse ? std::span<const Scales>(kCoarse) : std::span<const Scales>(kAll)) {
    SiftOptions sift = options;
    sift.max_image_side_px =
        std::min(options.max_image_side_px, std::max(grey.cols, grey.rows)) / scales.shrink;
    const int64_t num_pixels = NumSiftPixels(grey.size(), sift);
    const auto num_shrunk =
        static_cast<int64_t>(num_pixels < static_cast<int64_t>(grey.total()) ? grey.total() : 0);
    const int64_t of_pixels_ps = num_pixels * WorkBudget::PicosecondsOf(scales.pixel) +
                                 num_shrunk * WorkBudget::PicosecondsOf(Work::kShrunkPixel);
    const auto num_affordable = [&](double part) {
      return NumAffordable(work, of_feature_ps, part) - of_pixels_ps / of_feature_ps;
    };
    const int fewest = std::min(scales.fewest, options.max_num_features);
    if (num_affordable(scales.most_part) < fewest) continue;
    const int64_t num = std::max<int64_t>(fewest, num_affordable(kPart));
    sift.max_num_features = static_cast<int>(std::min<int64_t>(options.max_num_features, num));
    Spend(work, scales.pixel, num_pixels);
    Spend(work, Work::kShrunkPixel, num_shrunk);
    CAIRN_ASSIGN_OR_RETURN(Features features, scales.undoubled
                                                  ? ExtractUndoubledSift(grey, sift, *scales.undoubled)
                                                  : ExtractSift(grey, sift));
    Spend(work, Work::kFeature, features.keypoints.size());
    return std::optional(AffordedSift{std::move(features), MinScalePx(grey.size(), sift, scales)});
  }
  return std::optional<AffordedSift>();
}

Result<Features> AffordableFineSift(const cv::Mat& grey, const SiftOptions& options, int max_num,
                                    const std::function<bool(const Keypoint&)>& is_wanted,
                                    int64_t of_feature_ps, WorkBudget* work) {
  Features none;
  none.descriptors.resize(0, kSiftDescriptorDim);
  of_feature_ps += WorkBudget::PicosecondsOf(Work::kFeature);
  const int64_t num_pixels = NumSiftPixels(grey.size(), options);
  const int64_t num_affordable = NumAffordable(work, of_feature_ps, kPart) -
                                 num_pixels * WorkBudget::PicosecondsOf(Work::kFinePixel) / of_feature_ps;
  SiftOptions sift = options;
  sift.max_num_features = static_cast<int>(std::min<int64_t>(max_num, num_affordable));
  if (sift.max_num_features < 1 || !Spend(work, Work::kFinePixel, num_pixels)) return none;
  CAIRN_ASSIGN_OR_RETURN(Features features, ExtractUndoubledSift(grey, sift, SiftScales::kFine, is_wanted));
  Spend(work, Work::kFeature, features.keypoints.size());
  return features;
}

}  // namespace cairn
