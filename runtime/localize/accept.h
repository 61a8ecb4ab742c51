#pragma once

#include <string>
#include <vector>

#include "runtime/localize/localization.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"

namespace cairn {

// Probability that a keypoint lies within `max_error_px` of a landmark that it does not show, at this pose:
// measured on the matches themselves, each keypoint against the other matches' landmarks, and no less than a
// disc's share of the image.  Near 1 where all landmarks project into one corner: there, inliers say nothing.
double ChanceOfInlier(const std::vector<PoseMeasurement>& measurements, const Pose& cam_from_world,
                      double max_error_px, const Camera& camera);

// Expected number, as log10, of poses with at least `num_inliers` inliers among `num_matches` matches
// at random:
//   C(n, 3) C(n - 3, m - 3) p^(m - 3)
// [Moisan & Stival, "A probabilistic criterion to detect rigid point matches", 2004: number of false alarms]
double Log10ChancePoses(int num_matches, int num_inliers, double chance_of_inlier);

struct Verdict {
  NoFix reason = NoFix::kNone;
  std::string message;  // what was found and what was needed; empty for kNone
};

// How much likelier it is to find `num_found` of `num_in_view` landmarks where a right pose finds each with a
// probability of `min_found_ratio` or more, the likeliest, than where as many are found as beside their
// places: natural logarithm of the ratio of two binomial likelihoods.  -infinity where none is in view.
// REQUIRES: min_found_ratio in (0, 1)
double FoundLogOdds(int num_found, int num_in_view, double num_by_chance, double min_found_ratio);

// What guided matching says of a pose (match.h).
struct GuidedEvidence {
  int num_found = 0;
  int num_in_view = 0;       // landmarks that it looked for within the image
  double num_by_chance = 0;  // found beside their places
  bool is_sure = false;      // enough matches led to the pose: sure_num_unguided_inliers
};
// Whether that is more than chance, or than a part of the image that looks like another place.
Verdict JudgeGuided(const GuidedEvidence& evidence, const AcceptOptions& options);

// Whether a refined pose may be reported: enough inliers, well spread, certain, near the survey.
Verdict JudgePose(const RefinedPose& pose, const std::vector<Correspondence>& inliers, const Query& query,
                  double distance_from_survey_m, const AcceptOptions& options, const char* length_unit);

}  // namespace cairn
