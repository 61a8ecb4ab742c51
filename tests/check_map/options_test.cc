#include <gtest/gtest.h>

#include "stages/check_map/check_map.h"
#include "tests/option_limits.h"

namespace cairn::check_map {
namespace {

TEST(CheckMap, OptionsHaveTheRangesOfTheirComments) {
  ExpectLimits<CheckMapOptions>({{"gross_error_m", "1e-6", "9e-7"},
                                 {"gross_error_deg", "1e-6", "9e-7"},
                                 {"min_localized_ratio", "0", "-0.001", "1", "1.001"},
                                 {"min_precision_ratio", "0", "-0.001", "1", "1.001"},
                                 {"min_region_localized_ratio", "0", "-0.001", "1", "1.001"},
                                 {"min_region_precision_ratio", "0", "-0.001", "1", "1.001"},
                                 {"min_region_held_out", "1", "0"},
                                 {"max_station_heading_deg", "0", "-0.001", "180", "180.18"},
                                 {"max_station_distance_ratio", "0", "-0.001"},
                                 {"truth_sigma_m", "-1", "-1.001"},
                                 {"truth_sigma_deg", "-1", "-1.001"},
                                 {"plan_wall_distance_m", "1e-3", "9e-4"},
                                 {"plan_height_band_m", "0.01", "0.0099"},
                                 {"plan_max_shift_m", "0.1", "0.099", "10", "10.01"},
                                 {"plan_max_turn_deg", "0.1", "0.099", "45", "45.045"},
                                 {"plan_tolerance_m", "0.01", "0.0099"},
                                 {"plan_tolerance_deg", "0.05", "0.049"},
                                 {"min_plan_on_walls_ratio", "0", "-0.001", "1", "1.001"},
                                 {"scan_x_m", "-1000", "-1001", "1000", "1001"},
                                 {"scan_y_m", "-1000", "-1001", "1000", "1001"},
                                 {"scan_heading_deg", "-1000", "-1001", "1000", "1001"}});
}

}  // namespace
}  // namespace cairn::check_map
