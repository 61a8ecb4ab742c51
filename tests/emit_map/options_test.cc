#include <gtest/gtest.h>

#include "stages/emit_map/emit_map.h"
#include "tests/option_limits.h"

namespace cairn::emit_map {
namespace {

TEST(EmitMap, OptionsHaveTheRangesOfTheirComments) {
  ExpectLimits<EmitMapOptions>({{"max_bytes", "0", "-1"},
                                {"left_out_max_error_m", "1e-6", "9e-7"},
                                {"left_out_max_error_deg", "1e-6", "9e-7"},
                                {"min_recall_ratio", "0", "-0.001", "1", "1.001"},
                                {"max_error_ratio", "1", "0.999"},
                                {"least_error_ratio", "1e-6", "9e-7", "1", "1.001"},
                                {"promise_matches", "1", "0"},
                                {"promise_probability", "0.01", "0.0099", "0.999", "0.9991"},
                                {"max_region_landmarks", "1", "0"},
                                {"descriptor_bits", "1", "0", "8", "9"},
                                {"min_num_landmarks_for_words", "0", "-1"},
                                {"landmarks_per_word", "1", "0.999"},
                                {"max_num_words", "1", "0"},
                                {"max_num_sights", "16", "15"},
                                {"bad_model_px", "0", "-0.001"}});
}

}  // namespace
}  // namespace cairn::emit_map
