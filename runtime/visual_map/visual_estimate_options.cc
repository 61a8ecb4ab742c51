#include "runtime/visual_map/visual_estimate.h"

namespace cairn {

OptionTable DescribeOptions(VisualEstimateOptions* o) {
  return {
      {"visual_sigma_px", &o->visual_sigma_px,
       "visual map: standard deviation of a query's keypoint in addition to its model's, px", 1e-3},
      {"visual_sigma_octaves", &o->visual_sigma_octaves,
       "visual map: standard deviation of its scale in addition to its model's, octaves", 1e-3},
      {"outlier_ratio", &o->outlier_ratio, "visual map: share of wrong matches", 1e-6, 0.999},
      {"tilt_sigma_deg", &o->tilt_sigma_deg,
       "visual map: standard deviation of the camera's pitch and roll in addition to the survey's, degrees",
       1e-3, 45},
      {"height_sigma_m", &o->height_sigma_m,
       "visual map: standard deviation of the camera's height in addition to the survey's, metres", 1e-4},
      {"heading_margin_deg", &o->heading_margin_deg,
       "visual map: headings count this far beyond half way to the next of the survey, degrees", 0, 90},
      {"num_refined_places", &o->num_refined_places,
       "visual map: number of places and headings that are refined between places", 1},
      {"num_subdivisions", &o->num_subdivisions,
       "visual map: number of parts per side into which they are divided", 1, 100},
      {"shared_sigma_m", &o->shared_sigma_m,
       "visual map: errors that do not average out over landmarks, per axis, metres", 0},
      {"shared_sigma_deg", &o->shared_sigma_deg,
       "visual map: errors of the heading that do not average out over landmarks, degrees", 0},
      {"elsewhere_ratio", &o->elsewhere_ratio,
       "visual map: prior probability that the camera is at no place of the survey", 1e-9, 0.999},
      {"min_num_agreeing", &o->min_num_agreeing,
       "visual map: fewest matches that agree with a pose without a flag", 0},
      {"min_agreeing_ratio", &o->min_agreeing_ratio,
       "visual map: smallest part of the matches whose models extend to the pose that agree with it", 0, 1},
      {"min_spread_ratio", &o->min_spread_ratio,
       "visual map: smallest spread of agreeing matches in the image, as part of its diagonal", 0, 1},
      {"max_distance_spacings", &o->max_distance_spacings,
       "visual map: largest distance from the survey without a flag, in its spacings", 0},
      {"min_num_agreeing_unsure", &o->min_num_agreeing_unsure,
       "visual map: fewest matches that agree where left-out images of the survey are off by more than a "
       "quarter of its spacing",
       0}};
}

const char* VisualFlagName(VisualFlag flag) {
  switch (flag) {
    case VisualFlag::kNone:
      return "none";
    case VisualFlag::kTooFewMatches:
      return "too_few_matches";
    case VisualFlag::kOneSpot:
      return "one_spot";
    case VisualFlag::kDisagree:
      return "disagree";
    case VisualFlag::kOutside:
      return "outside";
  }
  return "none";
}

}  // namespace cairn
