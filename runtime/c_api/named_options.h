#pragma once

#include <cmath>
#include <initializer_list>

#include "core/features/sift.h"
#include "core/options/options.h"
#include "runtime/atlas/atlas_localizer.h"
#include "runtime/beams/scan_locator.h"
#include "runtime/drive/place_belief.h"
#include "runtime/drive/place_model.h"
#include "runtime/drive/sure_tracker.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/visual_map/visual_map.h"
#include "runtime/visual_map/visual_tracker.h"

// The options that callers in C and Python set by name, of all that they make: those that it reads, and no
// others, so that an option without effect is refused.  Inline, since Python's module has a copy of its own:
// the shared library exports none of this.
namespace cairn {

inline OptionTable JoinTables(std::initializer_list<OptionTable> tables) {
  OptionTable all;
  for (const OptionTable& table : tables) all.insert(all.end(), table.begin(), table.end());
  return all;
}

// All options that a look reads, and no others.
struct LookOptions {
  PlaceModelOptions model;
  SiftOptions sift;
  RerankOptions closer;
};
inline OptionTable DescribeOptions(LookOptions* options) {
  return JoinTables(
      {DescribeOptions(&options->model), DescribeOptions(&options->sift), DescribeOptions(&options->closer)});
}
// All options of a place belief and of the localizer that it looks with.
struct BeliefOptions {
  LocalizerOptions localizer;
  PlaceBeliefOptions belief;
};
inline OptionTable DescribeOptions(BeliefOptions* options) {
  return JoinTables({DescribeOptions(&options->belief), DescribeOptions(&options->localizer)});
}
inline constexpr const char* kBeliefOptionsHelp = "`cairn where --help-all` lists them";

// All options of an atlas's localizer.
struct AtlasSearchOptions {
  LocalizerOptions localizer;
  AtlasLocalizerOptions atlas;
};
inline OptionTable DescribeOptions(AtlasSearchOptions* options) {
  return JoinTables({DescribeOptions(&options->atlas), DescribeOptions(&options->localizer)});
}

struct SpaceTrackerOptions {
  LocalizerOptions localizer;
  RegionTrackerOptions tracker;
  SureTrackerOptions sure;
};
inline OptionTable DescribeOptions(SpaceTrackerOptions* options) {
  return JoinTables({DescribeOptions(&options->localizer), DescribeOptions(&options->tracker),
                     DescribeOptions(&options->tracker.votes), DescribeOptions(&options->sure)});
}

struct FloorTrackerOptions {
  LocalizerOptions features;  // of these, how features are found and how well they are measured
  VisualMapOptions map;
  VisualTrackerOptions tracker;
  VisualFilterOptions filter;
  VisualEstimateOptions estimate;
};
inline OptionTable DescribeOptions(FloorTrackerOptions* options) {
  return JoinTables({DescribeOptions(&options->features.sift),
                     DescribeOptions(&options->features.measurement), DescribeOptions(&options->map),
                     DescribeOptions(&options->tracker), DescribeOptions(&options->tracker.votes),
                     DescribeOptions(&options->filter), DescribeOptions(&options->estimate)});
}

// All options of a scan locator, and of how scans are read.
struct ScanSearchOptions {
  ScanLocatorOptions locator;
  ScanSegmentsOptions scan;
};
inline OptionTable DescribeOptions(ScanSearchOptions* options) {
  return JoinTables({DescribeOptions(&options->locator), DescribeOptions(&options->scan)});
}
inline constexpr const char* kScanOptionsHelp = "`cairn plan locate --help-all` lists them";
inline constexpr const char* kPlanTrackerOptionsHelp =
    "`cairn plan follow --help-all` lists them, and robot_on_plan.h below include/cairn where laser and "
    "camera stand";

// For a name that is near to none.
inline constexpr const char* kLookOptionsHelp =
    "place_model.h, sift.h and rerank_places.h below include/cairn list them";
inline constexpr const char* kStartOptionsHelp = "`cairn drive --help` lists them";
inline constexpr const char* kServoOptionsHelp =
    "servo.h, planar_epipoles.h and sift.h below include/cairn list them";

// Whether a caller's numbers can be scores of places; empty ones are not checked.  Errors: InvalidArgument.
inline Status CheckPlaceScores(const PlaceScores& given, int num_places) {
  for (const std::vector<double>* numbers : {&given.scores, &given.probabilities}) {
    if (numbers->empty()) continue;
    const char* name = numbers == &given.scores ? "scores" : "probabilities";
    if (numbers->size() != static_cast<size_t>(num_places))
      return MakeError(ErrorCode::kInvalidArgument, "places: {} {} for {} places", numbers->size(), name,
                       num_places);
    double sum = 0;
    for (const double number : *numbers) {
      if (!std::isfinite(number) || number < 0)
        return MakeError(ErrorCode::kInvalidArgument, "places: {} are not all finite and at least 0", name);
      sum += number;
    }
    if (numbers == &given.probabilities && !(std::abs(sum - 1) < 1e-6))
      return MakeError(ErrorCode::kInvalidArgument, "places: probabilities sum to {}; expected 1", sum);
  }
  return Ok();
}

}  // namespace cairn
