#include <gtest/gtest.h>

#include "stages/match_features/match_features.h"
#include "tests/option_limits.h"

namespace cairn::match_features {
namespace {

TEST(MatchFeatures, OptionsHaveTheRangesOfTheirComments) {
  ExpectLimits<MatchFeaturesOptions>({{"max_num_exhaustive_images", "0", "-1"},
                                      {"num_retrieved", "1", "0"},
                                      {"sequence_window", "1", "0"},
                                      {"num_loop_candidates", "0", "-1"},
                                      {"frustum_near_m", "1e-3", "9e-4"},
                                      {"frustum_far_m", "1e-3", "9e-4"},
                                      {"min_overlap_ratio", "0", "-0.001", "1", "1.001"},
                                      {"num_frustum_seeds", "0", "-1"},
                                      {"num_frustum_scouts", "0", "-1"},
                                      {"min_num_expected_matches", "1", "0"},
                                      {"earlier_partners_ratio", "0", "-0.001"},
                                      {"max_view_angle_deg", "1", "0.999", "180", "180.18"},
                                      {"max_scale_ratio", "1", "0.999"},
                                      {"max_ratio", "1e-3", "9e-4", "1", "1.001"},
                                      {"max_angle_rad", "1e-3", "9e-4", "3.2", "3.2032"},
                                      {"max_epipolar_error_px", "1e-3", "9e-4"},
                                      {"max_homography_error_px", "1e-3", "9e-4"},
                                      {"max_prior_error_px", "1e-3", "9e-4"},
                                      {"max_ray_angle_deg", "1", "0.999", "180", "180.18"},
                                      {"min_num_inliers", "8", "7"},
                                      {"min_homography_ratio", "0", "-0.001", "1", "1.001"},
                                      {"min_essential_ratio", "0", "-0.001", "1", "1.001"},
                                      {"min_baseline_m", "1e-12", "9e-13"},
                                      {"min_watermark_ratio", "0.5", "0.49", "1", "1.001"},
                                      {"watermark_border_ratio", "0", "-0.001", "0.5", "0.5005"},
                                      {"guided_max_ratio", "0", "-0.001", "1", "1.001"},
                                      {"guided_max_angle_rad", "1e-3", "9e-4", "3.2", "3.2032"},
                                      {"guided_max_scale_ratio", "1", "0.999"},
                                      {"guided_max_turn_deg", "1e-3", "9e-4", "180", "180.18"}});
}

}  // namespace
}  // namespace cairn::match_features
