#pragma once

#include <set>
#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/choose/leave_out_images.h"

namespace cairn::emit_map {

struct LeaveOutOptions {
  // Where a capture has no held-out images: part of the survey's images that try the map.  kAutoHoldOut: a
  // tenth, but at least 24 and at most 200, and of fewer than 48 images half.  0: none.  REQUIRES: in
  // [0, 0.5], or kAutoHoldOut
  static constexpr double kAutoHoldOut = -1;
  double hold_out = kAutoHoldOut;
};
OptionTable DescribeOptions(LeaveOutOptions* options);

// What is left out together, and which of it is tried; and in how many runs.
struct LeftOutRuns {
  std::vector<LeftOutImages> rounds;
  int num_runs = 0;
};

// Runs of consecutive images, spread evenly over the survey: of twelve images where the survey has 240 or
// more, of one in twenty where it has fewer, and of at least two.  With a run go all images of its images'
// views (core/promise/view_distance.h), before, after and from other passes or cameras, and of a panorama all
// views: no image that stays is as near to a tried one as that.  No more than one image in four is left out
// at a time: the runs share as many rounds as that takes, at most kMaxNumRounds.  A run whose views are more
// than a quarter of the survey is made shorter; if one image's view alone is, the run is not tried.  Pure.
// O(tried images * images).
// Errors: NoData, with a sentence that says why: fewer than twelve images, or than two to try; every view is
// more than a quarter. REQUIRES: hold_out is not 0 `never_tried`: positions of images that are in no run
// (LandmarkImages).
Result<LeftOutRuns> ChooseRuns(const Classes& classes, const LeaveOutOptions& options,
                               const std::set<size_t>& never_tried = {});

}  // namespace cairn::emit_map
