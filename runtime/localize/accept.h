#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/geometry/pose.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"

namespace cairn {

// Probability that a keypoint lies within `max_error_px` of a landmark that it does not show, at this pose:
// measured on the matches themselves, each keypoint against the other matches' landmarks, and no less than a
// disc's share of the images.  Near 1 where all landmarks project into one corner: there, inliers say
// nothing.
double ChanceOfInlier(std::span<const PoseMeasurement> measurements, const Pose& rig_from_world,
                      double max_error_px, const Sighting& sighting);

// Expected number, as log10, of poses with at least `num_inliers` inliers among `num_matches` matches
// at random, where s of them determine one (3; 2 with up):
//   C(n, s) C(n - s, m - s) p^(m - s)
// [Moisan & Stival, "A probabilistic criterion to detect rigid point matches", 2004: number of false alarms]
double Log10ChancePoses(int num_matches, int num_inliers, double chance_of_inlier, int sample_size = 3);

struct Verdict {
  NoFix reason = NoFix::kNone;
  std::string message;  // what was found and what was needed; empty for kNone
};

// Whether what guided matching found at a pose, `num_found`, is more than what it finds beside the landmarks'
// places by chance.
Verdict JudgeGuided(int num_found, double num_by_chance, const AcceptOptions& options);

// Whether a refined pose may be reported: enough inliers, well spread, certain, near the survey, and upright
// where up is known.
Verdict JudgePose(const RefinedPose& pose, std::span<const Correspondence> inliers, const Sighting& sighting,
                  double distance_from_survey_m, const AcceptOptions& options, const char* length_unit);

// Whether two poses are at different places.
bool AreFarApart(const Pose& a, const Pose& b, const AcceptOptions& accept);

// A localization that is kAmbiguous between poses with these odds, all considered: P / (1 - P).
// REQUIRES: as many odds as poses
Localization Ambiguous(Localization localization, std::vector<Pose> poses, std::vector<double> odds,
                       double odds_of_others, std::string message);

// Of localizations of one image, each among other landmarks, where it was taken.  Each is a fix or ambiguous;
// their numbers of matches compare where each was found among the landmarks of its own place, or all among
// the same.  Those at one place count once, by the one with most matches.  The fix with most, or ambiguous
// between it and every other place with max_second_pose_ratio of its matches, or with more than 1 /
// least_odds of its odds (max_second_pose_ratio 0: neither is tested).  A place a thousand times less likely
// than a fix is not counted, however many matches it has.  REQUIRES: at least one; least_odds >= 1
Localization DecideAmong(const std::vector<Localization>& found, double least_odds,
                         const AcceptOptions& accept);

// The better of two answers, found among other landmarks.  Of two that say nothing the one that came farther
// says more.  A fix at one of the places of an ambiguous answer does not decide for it, as the other place's
// landmarks may not be among those of the fix; unless it was found among all.
Localization BetterOf(Localization first, Localization second, const AcceptOptions& accept);

}  // namespace cairn
