#include <utility>

#include "stages/match_features/match_features.h"

namespace cairn::match_features {

OptionTable DescribeOptions(MatchFeaturesOptions* o) {
  OptionTable table = {
      {.name = "pairs",
       .value = &o->pairs,
       .help = "which images to match; auto: frustum where all images have poses, else exhaustive for few "
               "images, else retrieval",
       .choices = {"auto", "exhaustive", "frustum", "retrieval", "sequence"}},
      {.name = "max_num_exhaustive_images",
       .value = &o->max_num_exhaustive_images,
       .help = "pairs = auto: most images without poses that are matched exhaustively",
       .min = 0},
      {.name = "num_retrieved",
       .value = &o->num_retrieved,
       .help = "pairs = retrieval: number of most similar images that each image is matched with",
       .min = 1},
      {.name = "sequence_window",
       .value = &o->sequence_window,
       .help = "pairs = sequence: number of successors that each image is matched with",
       .min = 1},
      {.name = "num_loop_candidates",
       .value = &o->num_loop_candidates,
       .help = "pairs = sequence: number of most similar images, without neighbours, that each image is "
               "matched with",
       .min = 0},
      {.name = "frustum_near_m",
       .value = &o->frustum.near_m,
       .help = "pairs = frustum: nearest scene, metres",
       .min = 1e-3},
      {.name = "frustum_far_m",
       .value = &o->frustum.far_m,
       .help = "pairs = frustum: farthest scene, metres",
       .min = 1e-3},
      {.name = "min_overlap_ratio",
       .value = &o->frustum.min_overlap_ratio,
       .help = "pairs = frustum: smallest part of either frustum that the other camera sees",
       .min = 0,
       .max = 1},
      {.name = "num_frustum_seeds",
       .value = &o->num_frustum_seeds,
       .help = "pairs = frustum: number of images of largest overlap that each image is matched with at "
               "first, before the pairs that these matches predict; 0: match every pair whose frusta overlap",
       .min = 0},
      {.name = "num_frustum_scouts",
       .value = &o->num_frustum_scouts,
       .help = "pairs = frustum: number of images, spread over those of smaller overlap, that each is "
               "matched with at first",
       .min = 0},
      {.name = "min_num_expected_matches",
       .value = &o->min_num_expected_matches,
       .help = "pairs = frustum: fewest expected matches, by the matches of both images with others, of a "
               "pair that is matched after the seeds",
       .min = 1},
      {.name = "earlier_partners_ratio",
       .value = &o->earlier_partners_ratio,
       .help = "pairs = frustum: from the third session on, most images of all earlier sessions together "
               "that an image is matched with, over those of the one session that has the most for it; the "
               "seeds are matched in any case",
       .min = 0},
      {.name = "max_view_angle_deg",
       .value = &o->frustum.max_view_angle_deg,
       .help = "pairs = frustum: largest angle between two views of a point, degrees",
       .min = 1,
       .max = 180},
      {.name = "max_scale_ratio",
       .value = &o->frustum.max_scale_ratio,
       .help = "pairs = frustum: largest ratio of the two distances to a point",
       .min = 1},
  };
  for (OptionTable::value_type& option : DescribeOptions(&o->matching)) table.push_back(std::move(option));
  AddCondition({"pairs", {"auto"}}, {"max_num_exhaustive_images"}, &table);
  AddCondition({"pairs", {"auto", "retrieval"}}, {"num_retrieved"}, &table);
  AddCondition({"pairs", {"sequence"}}, {"sequence_window", "num_loop_candidates"}, &table);
  AddCondition(
      {"pairs", {"auto", "frustum"}},
      {"frustum_near_m", "frustum_far_m", "min_overlap_ratio", "num_frustum_seeds", "num_frustum_scouts",
       "min_num_expected_matches", "earlier_partners_ratio", "max_view_angle_deg", "max_scale_ratio"},
      &table);
  return table;
}

OptionTable DescribeOptions(MatchPairsOptions* o) {
  OptionTable table = {
      {.name = "search",
       .value = &o->search,
       .help = "exact: each descriptor is compared with all of the other image; approximate: with those that "
               "FLANN's trees or hashes offer, which misses some matches, between images of 20000 features "
               "and more; auto: approximate where it is faster, between images of some 600000",
       .choices = {"auto", "exact", "approximate"}},
      {.name = "max_ratio",
       .value = &o->matcher.max_ratio,
       .help = "largest ratio of the angles to the best and second best descriptor",
       .min = 1e-3,
       .max = 1},
      {.name = "max_angle_rad",
       .value = &o->matcher.max_angle_rad,
       .help = "largest angle between matched descriptors, radians",
       .min = 1e-3,
       .max = 3.2},
      {.name = "two_view",
       .value = &o->verification.two_view,
       .help = "how pairs are verified: by stated poses or five points; or, with poses or without, by eight "
               "points in plain RANSAC [Booij06]",
       .choices = {"five_point", "eight_point"}},
      {.name = "max_epipolar_error_px",
       .value = &o->verification.max_epipolar_error_px,
       .help = "largest distance of an inlier to its epipolar line, pixels",
       .min = 1e-3},
      {.name = "max_homography_error_px",
       .value = &o->verification.max_homography_error_px,
       .help = "largest distance of an inlier from where a homography puts it, pixels (COLMAP: 4)",
       .min = 1e-3},
      {.name = "max_prior_error_px",
       .value = &o->verification.max_prior_error_px,
       .help =
           "with known poses: largest distance of a match to the epipolar line of the stated poses, pixels",
       .min = 1e-3},
      {.name = "max_ray_angle_deg",
       .value = &o->verification.max_ray_angle_deg,
       .help = "with known poses: largest angle between the two rays of a match, degrees",
       .min = 1,
       .max = 180},
      {.name = "min_num_inliers",
       .value = &o->verification.min_num_inliers,
       .help = "fewest inliers of a verified pair",
       .min = 8},
      {.name = "min_homography_ratio",
       .value = &o->verification.min_homography_ratio,
       .help = "part of the inliers on one homography from which a pair is planar or panoramic (COLMAP: 0.8)",
       .min = 0,
       .max = 1},
      {.name = "min_essential_ratio",
       .value = &o->verification.min_essential_ratio,
       .help = "without poses: smallest ratio of the inliers of the essential to those of the fundamental "
               "matrix for the intrinsics to be accepted (COLMAP: 0.95)",
       .min = 0,
       .max = 1},
      {.name = "min_baseline_m",
       .value = &o->verification.min_baseline_m,
       .help = "with known poses: a shorter baseline counts as zero, metres",
       .min = 1e-12},
      {.name = "min_watermark_ratio",
       .value = &o->verification.min_watermark_ratio,
       .help = "part of the inliers on the image borders, shifted alike, from which a pair is a watermark "
               "(COLMAP: 0.7)",
       .min = 0.5,
       .max = 1},
      {.name = "watermark_border_ratio",
       .value = &o->verification.watermark_border_ratio,
       .help = "width of the border that holds watermarks, over the diagonal (COLMAP: 0.1)",
       .min = 0,
       .max = 0.5},
      {.name = "guided_matching",
       .value = &o->verification.guided_matching,
       .help = "which pairs are matched again along the epipolar lines of the geometry found: those whose "
               "poses are known, all, or none",
       .choices = {"posed", "all", "none"}},
      {.name = "guided_max_ratio",
       .value = &o->verification.guided.max_ratio,
       .help = "guided matching: largest ratio of the angles to the best and second best candidate",
       .min = 0,
       .max = 1},
      {.name = "guided_max_angle_rad",
       .value = &o->verification.guided.max_angle_rad,
       .help = "guided matching: largest angle between matched descriptors, radians",
       .min = 1e-3,
       .max = 3.2},
      {.name = "guided_max_scale_ratio",
       .value = &o->verification.guided.max_scale_ratio,
       .help = "guided matching: largest factor of a match's change of scale over that of the inliers",
       .min = 1},
      {.name = "guided_max_turn_deg",
       .value = &o->verification.guided.max_turn_deg,
       .help = "guided matching: largest angle between a match's change of orientation and that of the "
               "inliers, degrees",
       .min = 1e-3,
       .max = 180},
  };
  AddCondition({"guided_matching", {"posed", "all"}},
               {"guided_max_ratio", "guided_max_angle_rad", "guided_max_scale_ratio", "guided_max_turn_deg"},
               &table);
  return table;
}

}  // namespace cairn::match_features
