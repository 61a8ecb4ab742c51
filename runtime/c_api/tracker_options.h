#pragma once

#include "core/options/options.h"
#include "runtime/drive/sure_tracker.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/region_tracker.h"
#include "runtime/visual_map/visual_map.h"
#include "runtime/visual_map/visual_tracker.h"

// The options of trackers that callers in C and Python set by name: all that a tracker reads, and no others,
// so that an option without effect is refused.  Inline, since Python's module has a copy of its own: the
// shared library exports none of this.
namespace cairn {

struct SpaceTrackerOptions {
  LocalizerOptions localizer;
  RegionTrackerOptions tracker;
  SureTrackerOptions sure;
};
inline OptionTable DescribeOptions(SpaceTrackerOptions* options) {
  OptionTable all = DescribeOptions(&options->localizer);
  for (const OptionTable& part :
       {DescribeOptions(&options->tracker), DescribeOptions(&options->tracker.votes),
        DescribeOptions(&options->sure)}) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

struct FloorTrackerOptions {
  LocalizerOptions features;  // of these, how features are found and how well they are measured
  VisualMapOptions map;
  VisualTrackerOptions tracker;
  VisualFilterOptions filter;
  VisualEstimateOptions estimate;
};
inline OptionTable DescribeOptions(FloorTrackerOptions* options) {
  OptionTable all;
  for (const OptionTable& part :
       {DescribeOptions(&options->features.sift), DescribeOptions(&options->features.measurement),
        DescribeOptions(&options->map), DescribeOptions(&options->tracker),
        DescribeOptions(&options->tracker.votes), DescribeOptions(&options->filter),
        DescribeOptions(&options->estimate)}) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

}  // namespace cairn
