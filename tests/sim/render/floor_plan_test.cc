#include "sim/render/floor_plan.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "sim/render/building.h"

namespace cairn::sim {
namespace {

double Area(const Ring& ring) {
  double twice = 0;
  for (size_t i = 0; i < ring.size(); ++i) {
    const auto &a = ring[i], &b = ring[(i + 1) % ring.size()];
    twice += a[0] * b[1] - b[0] * a[1];
  }
  return twice / 2;
}

TEST(FreeSpace, HasAHoleAroundAPillar) {
  //  4 +-------+
  //    |  +-+  |
  //    |  +-+  |
  //  0 +-------+ 4
  const std::vector<PlanPolygon> free = FreeSpace({0, 0, 4, 4}, {{1, 1, 2, 3}});
  ASSERT_EQ(free.size(), 1u);
  EXPECT_EQ(free[0].outer, (Ring{{0, 0}, {4, 0}, {4, 4}, {0, 4}}));
  ASSERT_EQ(free[0].holes.size(), 1u);
  EXPECT_DOUBLE_EQ(Area(free[0].holes[0]), -2);
}

TEST(FreeSpace, HasTwoPartsOnBothSidesOfAWall) {
  const std::vector<PlanPolygon> free = FreeSpace({0, 0, 4, 4}, {{1, 0, 2, 4}});
  ASSERT_EQ(free.size(), 2u);
  EXPECT_EQ(free[0].outer, (Ring{{0, 0}, {1, 0}, {1, 4}, {0, 4}}));
  EXPECT_EQ(free[1].outer, (Ring{{2, 0}, {4, 0}, {4, 4}, {2, 4}}));
}

TEST(FreeSpace, MergesTouchingAndOverlappingObstacles) {
  //  two cabinets in the corner, one overlapping the other: an L is left, with 6 corners
  const std::vector<PlanPolygon> free =
      FreeSpace({0, 0, 4, 4}, {{0, 0, 1, 2}, {0, 1, 1, 3}, {0, 3, 1, 4}, {0, 3, 2, 4}});
  ASSERT_EQ(free.size(), 1u);
  EXPECT_EQ(free[0].outer, (Ring{{1, 0}, {4, 0}, {4, 4}, {2, 4}, {2, 3}, {1, 3}}));
  EXPECT_TRUE(free[0].holes.empty());
}

TEST(FreeSpace, KeepsPartsApartThatTouchAtACorner) {
  //    +--+--+
  //    |  |##|
  //    +--+--+
  //    |##|  |
  //    +--+--+
  const std::vector<PlanPolygon> free = FreeSpace({0, 0, 2, 2}, {{0, 0, 1, 1}, {1, 1, 2, 2}});
  ASSERT_EQ(free.size(), 2u);
  EXPECT_DOUBLE_EQ(Area(free[0].outer), 1);
  EXPECT_DOUBLE_EQ(Area(free[1].outer), 1);
}

TEST(FreeSpace, PutsAnIslandInsideAHole) {
  // A ring-shaped wall: outside, and a closed room inside.
  const std::vector<PlanPolygon> free =
      FreeSpace({0, 0, 9, 9}, {{2, 2, 7, 3}, {2, 6, 7, 7}, {2, 3, 3, 6}, {6, 3, 7, 6}});
  ASSERT_EQ(free.size(), 2u);
  ASSERT_EQ(free[0].holes.size(), 1u);
  EXPECT_DOUBLE_EQ(Area(free[0].holes[0]), -25);
  EXPECT_DOUBLE_EQ(Area(free[1].outer), 9);
  EXPECT_TRUE(free[1].holes.empty());
}

TEST(WriteFloorPlan, WritesClosedRingsInsideTheBuilding) {
  SimulateOptions options;
  options.texel_m = 0.05;
  const Result<Building> building = MakeBuilding(options, 0);
  ASSERT_TRUE(building.ok());
  const std::string path = testing::TempDir() + "/floor_plan_test.geojson";
  ASSERT_TRUE(WriteFloorPlan(building->layout, building->obstacles, path).ok());
  const nlohmann::json plan = nlohmann::json::parse(std::ifstream(path));
  std::filesystem::remove(path);
  EXPECT_EQ(plan["type"], "FeatureCollection");
  const nlohmann::json& free = plan["features"][0];
  EXPECT_EQ(free["properties"]["kind"], "free_space");
  ASSERT_EQ(free["geometry"]["type"], "Polygon");  // all rooms hang together
  double area = 0;
  for (const nlohmann::json& ring : free["geometry"]["coordinates"]) {
    EXPECT_GE(ring.size(), 5u);
    EXPECT_EQ(ring.front(), ring.back());
    area += Area(ring.get<Ring>());
    for (const nlohmann::json& corner : ring) {
      EXPECT_TRUE(corner[0] >= 0 && corner[0] <= options.width_m && corner[1] >= 0 &&
                  corner[1] <= options.depth_m);
    }
  }
  // Against counting free places.
  int num_free = 0, num_places = 0;
  for (double y = 0.01; y < options.depth_m; y += 0.02) {
    for (double x = 0.01; x < options.width_m; x += 0.02, ++num_places)
      num_free += ClearanceM(*building, x, y) > 0;
  }
  EXPECT_NEAR(area, options.width_m * options.depth_m * num_free / num_places, 0.3);
  std::map<std::string, int> kinds;
  for (const nlohmann::json& feature : plan["features"])
    ++kinds[feature["properties"]["kind"].get<std::string>()];
  EXPECT_EQ(kinds["room"], options.num_rooms);
  EXPECT_EQ(kinds["corridor"], 1);
  EXPECT_EQ(kinds["wall"], static_cast<int>(building->layout.walls.size()));
}

}  // namespace
}  // namespace cairn::sim
