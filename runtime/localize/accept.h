#pragma once

#include <string>
#include <vector>

#include "core/options/options.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "runtime/map/map.h"

namespace cairn {

// Why there is no fix.
enum class NoFix {
  kNone,            // there is one
  kTooFewFeatures,  // blank, dark or blurred image
  kNoCandidates,    // nothing in the map looks like it
  kTooFewMatches,   // few landmarks recognised
  kNoPose,          // the matches agree on no pose
  kTooFewInliers,   // too few of them do
  kPoorSpread,      // they lie close together in the image
  kUncertain,       // they leave the pose too uncertain
  kFarFromSurvey,   // they put the camera where nobody surveyed
  kAmbiguous,       // another pose is nearly as good
};
// Stable lower-case name ("too_few_matches"); "none" for kNone.
const char* NoFixName(NoFix reason);

struct AcceptOptions {
  // Minimum number of features of the image.  REQUIRES: >= 4
  int min_num_features = 30;
  // Minimum number of matches for which a pose is tried.  REQUIRES: >= 4
  int min_num_matches = 7;
  // Minimum number of matches, found without knowing the pose, that agree with it.  REQUIRES: >= 4
  int min_num_unguided_inliers = 6;
  // Largest log10 of the number of poses that would have as many inliers if all matches were
  // random (Log10ChancePoses).
  double max_log10_chance = -4;
  // Minimum number of inliers in all.  REQUIRES: >= 5
  int min_num_inliers = 7;
  // Least part of the inliers found without knowing the pose that refinement must keep (by number): where
  // points crowd in the image, many lie within the wide limit of a wrong pose and few within the refined
  // one's.  REQUIRES: in [0, 1]
  double min_kept_ratio = 0.5;
  // The image is cut into spread_grid x spread_grid cells, of which inliers must lie in at least
  // min_num_cells.  REQUIRES: >= 1
  int spread_grid = 6;
  int min_num_cells = 4;
  // Largest standard deviation of the camera's place, m, and of its rotation, degrees, in the worst
  // direction.  REQUIRES: > 0
  double max_sigma_m = 0.5;
  double max_sigma_deg = 5;
  // Largest distance from the nearest survey image, m; 0: any.  REQUIRES: >= 0
  double max_distance_from_survey_m = 5;
  // A second pose that has this part of the first one's inliers, at another place, makes the fix ambiguous;
  // 0: not looked for.  REQUIRES: in [0, 1]
  double max_second_pose_ratio = 0.6;
  // Samples that look for the second pose.  REQUIRES: >= 1
  int num_second_pose_iterations = 200;
  // Poses at least this far apart, m or degrees, are different.  REQUIRES: > 0
  double second_pose_distance_m = 0.5;
  double second_pose_angle_deg = 15;
};
OptionTable DescribeOptions(AcceptOptions* options);

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

// Whether a refined pose may be reported: enough inliers, well spread, certain, near the survey.
Verdict JudgePose(const RefinedPose& pose, const std::vector<Correspondence>& inliers, const Query& query,
                  double distance_from_survey_m, const AcceptOptions& options);

}  // namespace cairn
