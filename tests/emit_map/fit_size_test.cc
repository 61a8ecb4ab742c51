#include "stages/emit_map/choose/fit_size.h"

#include <gtest/gtest.h>

namespace cairn::emit_map {
namespace {

TEST(GuaranteeOf, CountsCommonLandmarksAndPoorStations) {
  MapRows rows;
  rows.k = 2;
  rows.stations.resize(2);
  rows.landmarks.resize(3);
  rows.images = {{.image_id = 1, .station = 0, .landmarks = {0, 1, 2}},
                 {.image_id = 2, .station = 1, .landmarks = {2}}};
  rows.regions = {{.stations = {0}, .landmarks = {0, 1, 2}}, {.stations = {0, 1}, .landmarks = {2}}};
  const SizeGuarantee guarantee = GuaranteeOf(rows);
  EXPECT_EQ(guarantee.min_common_landmarks, 1);
  EXPECT_EQ(guarantee.num_stations_below_k, 1);
  EXPECT_EQ(GuaranteeOf({}).min_common_landmarks, 0);
}

}  // namespace
}  // namespace cairn::emit_map
