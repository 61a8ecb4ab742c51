#include <gtest/gtest.h>

#include "stages/link_appearance/check_appearance.h"
#include "stages/link_appearance/link_appearance.h"
#include "tests/option_limits.h"

namespace cairn::link_appearance {
namespace {

TEST(LinkAppearance, OptionsHaveTheRangesOfTheirComments) {
  ExpectLimits<LinkAppearanceOptions>({{"min_num_inliers", "1", "0"},
                                       {"max_link_distance_m", "0", "-0.001"},
                                       {"max_link_turn_deg", "0", "-0.001", "180", "180.18"},
                                       {"same_place_m", "1e-6", "9e-7"},
                                       {"max_num_dropped", "0", "-1"},
                                       {"num_dominators", "1", "0"},
                                       {"strong_num_inliers", "1", "0"},
                                       {"min_component_nodes", "1", "0"},
                                       {"num_kept", "0", "-1"},
                                       {"num_tries", "0", "-1"},
                                       {"max_detour_links", "0", "-1"},
                                       {"max_num_program_links", "0", "-1"},
                                       {"max_num_cut_rounds", "0", "-1"},
                                       {"score_exponent", "1e-3", "9e-4", "100", "100.1"},
                                       {"confusable_score_ratio", "1e-3", "9e-4", "1", "1.001"},
                                       {"confusable_distance_m", "1e-6", "9e-7"},
                                       {"max_num_confusable", "0", "-1"}});
}

TEST(CheckAppearance, OptionsHaveTheRangesOfTheirComments) {
  ExpectLimits<CheckAppearanceOptions>({{"kept_ratios", "0", "-0.001", "1", "1.001"},
                                        {"weighted_num_inliers", "1", "0"},
                                        {"max_num_dominators", "1", "0"}});
}

}  // namespace
}  // namespace cairn::link_appearance
