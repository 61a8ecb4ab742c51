#pragma once

#include <optional>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/features/sift.h"
#include "core/work/work_budget.h"

namespace cairn {

// Features that there was work for.
struct AffordedSift {
  Features features;
  // Smaller ones were not looked for in all of the image: sigma, px; 0: of all scales.
  double min_scale_px = 0;
};

// Features of an image that half of what is left of a budget is enough for, or, where that is nothing, three
// quarters: all of them; else, as there is less and less room, those of the image's own pixels
// (ExtractUndoubledSift), of coarse scales, of an image half as large, a quarter as large; and of each the
// strongest.  Nothing if there is no room for as many as lead anywhere.  `coarse`: no more than coarse ones.
// `of_feature_ps`: what each takes besides.  Errors: as ExtractSift.
Result<std::optional<AffordedSift>> AffordableSift(const cv::Mat& grey, const SiftOptions& options,
                                                   bool coarse, int64_t of_feature_ps, WorkBudget* work);

// The fine ones of ExtractUndoubledSift, at most so many; none where there is no room for them.
Result<Features> AffordableFineSift(const cv::Mat& grey, const SiftOptions& options, int max_num,
                                    const std::function<bool(const Keypoint&)>& is_wanted,
                                    int64_t of_feature_ps, WorkBudget* work);

}  // namespace cairn
