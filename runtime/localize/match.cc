#include "runtime/localize/match.h"

#include "core/features/descriptor_matcher.h"

namespace cairn {

OptionTable DescribeOptions(MatchOptions* o) {
  OptionTable table = {
      {.name = "max_ratio",
       .value = &o->max_ratio,
       .help = "largest ratio of best to second-best descriptor angle, both ways",
       .min = 1e-3,
       .max = 1},
      {.name = "max_angle_rad",
       .value = &o->max_angle_rad,
       .help = "largest descriptor angle of a match, radians",
       .min = 1e-3},
      {.name = "guided_radius_px",
       .value = &o->guided_radius_px,
       .help = "a landmark is looked for this near to its projection, px",
       .min = 0.1},
      {.name = "guided_radius_sigmas",
       .value = &o->guided_radius_sigmas,
       .help = "plus this many standard deviations of its own position, projected",
       .min = 0},
      {.name = "guided_max_angle_rad",
       .value = &o->guided_max_angle_rad,
       .help = "guided matching: largest descriptor angle of a match, radians",
       .min = 1e-3},
      {.name = "guided_max_scale_ratio",
       .value = &o->guided_max_scale_ratio,
       .help = "largest ratio of a keypoint's scale to the predicted one, either way",
       .min = 1},
      {.name = "guided_num_images",
       .value = &o->guided_num_images,
       .help = "survey images whose landmarks are looked for; 0: no guided matching",
       .min = 0},
      {.name = "guided_widest",
       .value = &o->guided_widest,
       .help = "where few matches led to a pose, landmarks are first looked for this many times as far from "
               "their projections, then half as far, and so on; 1: not",
       .min = 1,
       .max = 64},
      {.name = "guided_sure_num_inliers",
       .value = &o->guided_sure_num_inliers,
       .help = "so many matches are not few",
       .min = 0},
      {.name = "guided_max_num_rounds",
       .value = &o->guided_max_num_rounds,
       .help = "most rounds of guided matching, each at the pose that the one before refined",
       .min = 1},
  };
  AddCondition({"guided_widest", {"not 1"}}, {"guided_sure_num_inliers"}, &table);
  return table;
}

std::vector<Correspondence> MatchLandmarks(const Query& query, const LandmarkSet& landmarks,
                                           const MatchOptions& options) {
  const DescriptorMatcherOptions matcher_options{
      .max_ratio = options.max_ratio, .max_angle_rad = options.max_angle_rad, .mutual = true};
  std::vector<Correspondence> correspondences;
  for (const Match& match : MatchDescriptors(query.packed, landmarks.packed, matcher_options)) {
    if (query.rays[match.idx1]) correspondences.push_back({match.idx1, landmarks.idx[match.idx2]});
  }
  return correspondences;
}

}  // namespace cairn
