#pragma once

#include <vector>

#include "pipeline/build/stage_options.h"

namespace cairn::pipeline {

// Four stages with a few options each, so that tests of recipes do not change with the stages' own options.
struct ExtractTestOptions {
  int max_num_features = 2000;
  double contrast_threshold = 0.02;
};
inline OptionTable DescribeOptions(ExtractTestOptions* o) {
  return {{.name = "max_num_features", .value = &o->max_num_features, .help = "most features", .min = 1},
          {.name = "contrast_threshold",
           .value = &o->contrast_threshold,
           .help = "contrast",
           .min = 0,
           .max = 1}};
}

struct VisibilityTestOptions {
  std::string up = "auto";
  bool strict = true;
};
inline OptionTable DescribeOptions(VisibilityTestOptions* o) {
  return {{.name = "up", .value = &o->up, .help = "up"},
          {.name = "strict", .value = &o->strict, .help = "strict"}};
}

struct SimulateTestOptions {
  double width_m = 9.5;
};
inline OptionTable DescribeOptions(SimulateTestOptions* o) {
  return {{.name = "width_m", .value = &o->width_m, .help = "width", .min = 4, .max = 200}};
}

struct CheckTestOptions {
  double min_localized_ratio = 0;
  double gross_error_m = 0.5;
};
inline OptionTable DescribeOptions(CheckTestOptions* o) {
  return {
      {.name = "min_localized_ratio", .value = &o->min_localized_ratio, .help = "gate", .min = 0, .max = 1},
      {.name = "gross_error_m", .value = &o->gross_error_m, .help = "gross", .min = 0}};
}

inline std::vector<StageOptions> TestStages() {
  return {MakeStageOptions<SimulateTestOptions>("simulate"),
          MakeStageOptions<ExtractTestOptions>("extract_features"),
          MakeStageOptions<VisibilityTestOptions>("filter_visibility"),
          MakeStageOptions<CheckTestOptions>("check_map")};
}

}  // namespace cairn::pipeline
