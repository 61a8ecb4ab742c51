#pragma once

#include <string>

#include "core/features/sift.h"
#include "core/options/options.h"

namespace cairn {

// How well a keypoint is measured (runtime/localize/measurement.h).
struct MeasurementOptions {
  // Standard deviation of a small keypoint's position, px.  REQUIRES: > 0
  double keypoint_sigma_px = 0.5;
  // Growth of that standard deviation with the keypoint's scale (sigma, px): they add as squares.
  // REQUIRES: >= 0
  double keypoint_sigma_per_scale = 0.2;
};
OptionTable DescribeOptions(MeasurementOptions* options);

// Which survey images and regions are candidates (retrieve.h).
struct RetrieveOptions {
  // Most candidate images.  REQUIRES: >= 1
  int max_num_candidates = 20;
  // Candidates score at least this part of the best one's score [Mariottini11 fn 4: a percentage of the
  // maximum, not given]. REQUIRES: in [0, 1]
  double min_score_ratio = 0.3;
  // Without a vocabulary: largest angle between a descriptor and the landmark that is its word, radians.
  // REQUIRES: > 0
  double max_word_angle_rad = 0.8;
  // And largest ratio of that angle to the one of the second nearest landmark.  REQUIRES: in (0, 1]
  double max_word_ratio = 0.95;
  // Most regions whose landmarks are matched first.  REQUIRES: >= 1
  int max_num_regions = 12;
  // With a prior: survey images within this distance and angle of it (beyond 3 of its standard deviations)
  // are candidates.  REQUIRES: >= 0
  double prior_distance_m = 3;
  double prior_angle_deg = 45;
};
OptionTable DescribeOptions(RetrieveOptions* options);

// Matches with their landmarks (match.h).
struct MatchOptions {
  // Largest ratio of best to second-best descriptor angle, both ways.  REQUIRES: in (0, 1]
  double max_ratio = 0.85;
  // Largest angle between the descriptors of a match, radians.  REQUIRES: > 0
  double max_angle_rad = 0.8;

  // Guided by a first pose: a landmark is looked for within guided_radius_px of its projection and
  // guided_radius_sigmas standard deviations of its own position, projected; the two add as squares.  A
  // radius smaller than the errors that the landmarks' covariances predict would make the pose's covariance
  // too small.  REQUIRES: guided_radius_px > 0, guided_radius_sigmas >= 0
  double guided_radius_px = 10;
  double guided_radius_sigmas = 3;
  // Largest descriptor angle of a guided match, radians.  REQUIRES: > 0
  double guided_max_angle_rad = 0.7;
  // Largest ratio of the keypoint's scale to the one that the landmark's size predicts, or of its inverse.
  // REQUIRES: >= 1
  double guided_max_scale_ratio = 2.5;
  // Landmarks looked for are those of this many survey images, which share most inliers with the query; 0: no
  // guided matching.  REQUIRES: >= 0
  int guided_num_images = 12;
  // Where fewer than guided_sure_num_inliers matches led to a pose: landmarks are first looked for this many
  // times guided_radius_px from their projections, then half as far, and so on down to it, and each time the
  // pose is estimated anew.  1: not.  REQUIRES: in [1, 64]
  double guided_widest = 4;
  int guided_sure_num_inliers = 40;
  // Most rounds of guided matching: what one finds refines the pose for the next, as long as that finds more.
  // REQUIRES: >= 1
  int guided_max_num_rounds = 4;
};
OptionTable DescribeOptions(MatchOptions* options);

// The first pose (estimate.h).
struct EstimateOptions {
  // Largest reprojection error of an inlier, px.  REQUIRES: > 0
  double max_error_px = 6;
  // Probability of drawing one sample of inliers only, at the inlier ratio found so far.  REQUIRES: in (0, 1)
  double confidence = 0.9999;
  // REQUIRES: >= 1
  int min_num_ransac_iterations = 64;
  int max_num_ransac_iterations = 3000;
  // Where fewer than sure_num_unguided_inliers matches agree on a pose: up to so many poses, of other
  // matches, are followed up, and that at which guided matching finds most is the one.  REQUIRES: >= 1
  int max_num_first_poses = 3;
};
OptionTable DescribeOptions(EstimateOptions* options);

// The refined pose and its covariance (refine.h).
struct RefineOptions {
  // Whitened residual (standard deviations) from which a measurement loses weight (Cauchy's loss).
  // REQUIRES: > 0
  double robust_scale = 2.5;
  // Most Levenberg-Marquardt steps.  REQUIRES: >= 1
  int max_num_refine_iterations = 20;
  // Squared whitened residual, over the estimated noise, up to which a measurement is an inlier: chi-square
  // of 2 degrees of freedom at 99 %.  REQUIRES: > 0
  double inlier_chi_square = 9.21;
  // Factor on the reported covariance.  REQUIRES: > 0
  double covariance_scale = 1;
  // Which part of its variance a keypoint shares with the others of its image: the covariance of n inliers is
  // 1 + n / 2 * this times as large as the normal matrix says.  0: what the map's survey showed.
  // REQUIRES: in [0, 1]
  double keypoint_correlation = 0;
  // Errors that more landmarks do not average out (survey poses, intrinsics): added to the covariance of the
  // camera's place, m, and of its rotation, degrees, as standard deviations per axis.  REQUIRES: >= 0
  double systematic_sigma_m = 0;
  double systematic_sigma_deg = 0;
};
OptionTable DescribeOptions(RefineOptions* options);

// Whether it is reported (accept.h).
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
  // Guided matching finds some landmarks by chance, at any pose: where it finds c of them beside their places
  // (GuidedByChance), it must find more than c + min_guided_sigmas sqrt(c) at these (as many standard
  // deviations of a Poisson number).  0: not tested.  REQUIRES: >= 0
  double min_guided_sigmas = 5.5;
  // Least probability that the pose is right, by what near survey images see and by how much of it is found
  // (place_evidence.h): a part of the image alone may look like another place, and then most of what should
  // be around it is missing.  0: not tested.  REQUIRES: in [0, 1]
  double min_probability = 0.3;
  // The image is cut into spread_grid x spread_grid cells, of which inliers must lie in at least
  // min_num_cells.  REQUIRES: >= 1
  int spread_grid = 6;
  int min_num_cells = 4;
  // Largest standard deviation of the camera's place, m, and of its rotation, degrees, in the worst
  // direction.  REQUIRES: > 0
  double max_sigma_m = 0.5;
  double max_sigma_deg = 5;
  // Where up is known (SensedUp): largest angle between where a fix has it and where it was sensed, standard
  // deviations of both.  REQUIRES: > 0
  double max_up_sigmas = 4;
  // Largest distance from the nearest survey image, m; 0: any.  REQUIRES: >= 0
  double max_distance_from_survey_m = 5;
  // A second pose at another place that has half this part of the first one's inliers is followed up too; if
  // it leads to this part of what the better of them leads to, the fix is ambiguous.  0: not looked for.
  // REQUIRES: in [0, 1]
  double max_second_pose_ratio = 0.6;
  // Samples that look for the second pose.  REQUIRES: >= 1
  int num_second_pose_iterations = 200;
  // Poses at least this far apart, m or degrees, are different.  REQUIRES: > 0
  double second_pose_distance_m = 0.5;
  double second_pose_angle_deg = 15;
};
OptionTable DescribeOptions(AcceptOptions* options);

// The options of every piece of localization, in the order in which they act.
struct LocalizerOptions {
  SiftOptions sift;
  MeasurementOptions measurement;
  RetrieveOptions retrieve;
  MatchOptions match;
  EstimateOptions estimate;
  RefineOptions refine;
  AcceptOptions accept;
  // Landmarks to match first: of the candidates' regions, or of the candidate images themselves; "auto":
  // regions, unless the map keeps landmarks that no region has.
  std::string first_landmarks = "auto";
  // A fix with at least this many inliers found without the pose is taken at once; with fewer, the other sets
  // of landmarks are tried too, and the fix with the most inliers counts: look-alikes give
  // few.  REQUIRES: >= 0
  int sure_num_unguided_inliers = 20;
  // Where the map knows that the place of a fix looks like others that lie elsewhere [Mariottini11 §V], try
  // these too, each among the landmarks of its own place, unless a prior excludes them: the fix is withheld
  // as long as one of them explains the image nearly as well (max_second_pose_ratio), or it is not at least
  // so many times likelier than at any of them: how densely each was surveyed makes up to a factor of 30
  // (twin wings, bench/drive).  REQUIRES: >= 1
  bool exclude_look_alikes = true;
  double min_look_alike_odds = 100;
  // How well the map's up is known, degrees per axis: that of its floor, against which a sensed up is held.
  // REQUIRES: > 0
  double floor_up_sigma_deg = 2;
  // Most work for an answer, milliseconds of a core that is core_speed times as fast as the one on which work
  // was measured (core/work/work_budget.h); 0: any.  Where it is less than all features of an image take,
  // fewer are sought, and fewer landmarks; what makes a fix sure is never left out: where there is no room
  // for it, there is none (NoFix::kOverBudget).  Work is counted and not timed: the same image, the same
  // answer. Reading the map's parts from the disk is not counted.  REQUIRES: >= 0, > 0
  double budget_ms = 0;
  double core_speed = 1;
  // Try all landmarks of the map when those fail, if they are not more than this.  REQUIRES: >= 0
  bool fall_back_to_all = true;
  int fall_back_max_num_landmarks = 200000;
};
OptionTable DescribeOptions(LocalizerOptions* options);

}  // namespace cairn
