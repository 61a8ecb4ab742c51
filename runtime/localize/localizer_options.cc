#include "runtime/localize/localizer_options.h"

namespace cairn {

OptionTable DescribeOptions(LocalizerOptions* options) {
  OptionTable table;
  for (const OptionTable& part : {DescribeOptions(&options->sift), DescribeOptions(&options->measurement),
                                  DescribeOptions(&options->retrieve), DescribeOptions(&options->match),
                                  DescribeOptions(&options->estimate), DescribeOptions(&options->refine),
                                  DescribeOptions(&options->accept)}) {
    table.insert(table.end(), part.begin(), part.end());
  }
  table.push_back(
      {.name = "first_landmarks",
       .value = &options->first_landmarks,
       .help = "landmarks to match first: of the candidates' regions or of the candidate images; auto: "
               "regions, unless the map keeps landmarks that no region has",
       .choices = {"auto", "regions", "images"}});
  table.push_back(
      {.name = "exclude_look_alikes",
       .value = &options->exclude_look_alikes,
       .help = "withhold a fix while a place that looks alike explains the image nearly as well"});
  table.push_back({"min_look_alike_odds", &options->min_look_alike_odds,
                   "a fix must be so many times likelier than the same at a place that looks alike", 1});
  table.push_back(
      {.name = "floor_up_sigma_deg",
       .value = &options->floor_up_sigma_deg,
       .help = "where up is sensed: how well the map knows which way is up from its floor, degrees",
       .min = 0.01,
       .max = 90});
  table.push_back(
      {.name = "budget_ms",
       .value = &options->budget_ms,
       .help = "most work for an answer, ms of a core as fast as core_speed says; counted, not timed; 0: any",
       .min = 0});
  table.push_back({.name = "core_speed",
                   .value = &options->core_speed,
                   .help = "how fast a core is, beside the one on which work was measured (AMD Zen 5)",
                   .min = 1e-3,
                   .max = 1e3});
  AddCondition({"budget_ms", {"not 0"}}, {"core_speed"}, &table);
  table.push_back({.name = "fall_back_to_all",
                   .value = &options->fall_back_to_all,
                   .help = "try all landmarks of the map when those fail"});
  table.push_back(
      {.name = "sure_num_unguided_inliers",
       .value = &options->sure_num_unguided_inliers,
       .help =
           "a fix with at least this many unguided inliers is taken without trying more landmarks or poses",
       .min = 0});
  table.push_back({.name = "fall_back_max_num_landmarks",
                   .value = &options->fall_back_max_num_landmarks,
                   .help = "largest map, in landmarks, in which all are tried",
                   .min = 0});
  AddCondition({"fall_back_to_all", {"true"}}, {"fall_back_max_num_landmarks"}, &table);
  return table;
}

}  // namespace cairn
