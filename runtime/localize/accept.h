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

// Whether what guided matching found at a pose, `num_found`, is more than what it finds beside the landmarks'
// places by chance.
Verdict JudgeGuided(int num_found, double num_by_chance, const AcceptOptions& options);

// Whether a refined pose may be reported: enough inliers, well spread, certain, near the survey.
Verdict JudgePose(const RefinedPose& pose, const std::vector<Correspondence>& inliers, const Query& query,
                  double distance_from_survey_m, const AcceptOptions& options, const char* length_unit);

}  // namespace cairn
