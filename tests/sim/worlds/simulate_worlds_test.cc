#include "sim/worlds/simulate_worlds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::sim {
namespace {

using testing::ElementsAre;

Polygon Box(double min_x, double min_y, double max_x, double max_y) {
  return {{min_x, min_y}, {max_x, min_y}, {max_x, max_y}, {min_x, max_y}};
}

// A room of 4 m x 3 m around the lattice points (1, 1), (2, 1), (3, 1) and (1, 2), (2, 2), (3, 2) of a 1
// m lattice.
WorldPlan Room() { return {.perimeter = Box(0.5, 0.5, 3.5, 2.5)}; }

TEST(SampleFloorPlan, StationsAreTheLatticePointsInFreeSpace) {
  const World world = SampleFloorPlan(Room(), 1.0);
  EXPECT_THAT(world.positions,
              ElementsAre(Eigen::Vector2d(1, 1), Eigen::Vector2d(2, 1), Eigen::Vector2d(3, 1),
                          Eigen::Vector2d(1, 2), Eigen::Vector2d(2, 2), Eigen::Vector2d(3, 2)));
  //  3 - 4 - 5
  //  |   |   |
  //  0 - 1 - 2
  EXPECT_THAT(world.edges, ElementsAre(std::pair(0, 1), std::pair(0, 3), std::pair(1, 2), std::pair(1, 4),
                                       std::pair(2, 5), std::pair(3, 4), std::pair(4, 5)));
}

TEST(SampleFloorPlan, ObstaclesTakeStationsAndPassages) {
  // The obstacle stands on (2, 1); a thin one between (1, 2) and (2, 2) blocks the way, so that the left part
  // with two stations falls away.
  WorldPlan plan = Room();
  plan.obstacles = {Box(1.8, 0.8, 2.2, 1.2), Box(1.4, 1.6, 1.6, 2.45)};
  const World world = SampleFloorPlan(plan, 1.0);
  EXPECT_THAT(world.positions,
              ElementsAre(Eigen::Vector2d(3, 1), Eigen::Vector2d(2, 2), Eigen::Vector2d(3, 2)));
  EXPECT_THAT(world.edges, ElementsAre(std::pair(0, 2), std::pair(1, 2)));
}

TEST(SampleFloorPlan, FeatureIsSeenWithinItsAngleAndRange) {
  // On the left wall at y = 1, looking right; stations 0, 1, 2 stand at distances 0.5, 1.5, 2.5 straight
  // ahead, 3, 4, 5 one metre higher at 63, 34 and 22 degrees.
  WorldPlan plan = Room();
  const auto area = [&](double opening_deg, double near_m, double far_m) {
    plan.features = {{{0.5, 1}, {1, 0}, opening_deg, near_m, far_m}};
    return SampleFloorPlan(plan, 1.0).areas[0];
  };
  EXPECT_THAT(area(25, 0, 10), ElementsAre(0, 1, 2));
  EXPECT_THAT(area(45, 0, 10), ElementsAre(0, 1, 2, 5));
  EXPECT_THAT(area(90, 0, 10), ElementsAre(0, 1, 2, 4, 5));
  EXPECT_THAT(area(25, 1, 2), ElementsAre(1));
}

TEST(SampleFloorPlan, WallsHideFeatures) {
  WorldPlan plan = Room();
  plan.obstacles = {Box(2.4, 0.9, 2.6, 1.1)};  // between stations 1 and 2: the edge goes as well
  plan.features = {{{0.5, 1}, {1, 0}, 90, 0, 10}};
  EXPECT_THAT(SampleFloorPlan(plan, 1.0).areas[0], ElementsAre(0, 1, 4, 5));
}

TEST(SimulateWorld, SettingsGiveValidWorldsWithAboutAHundredVisibleFeatures) {
  for (int setting = 1; setting <= 4; ++setting) {
    SimulateWorldsOptions options;
    options.setting = setting;
    const Result<World> world = SimulateWorld(options, 7);
    ASSERT_TRUE(world.ok());
    EXPECT_TRUE(CheckWorld(*world).ok());
    size_t num_incidences = 0;
    for (const std::vector<StationIdx>& area : world->areas) num_incidences += area.size();
    const double visible = static_cast<double>(num_incidences) / world->num_stations();
    EXPECT_GT(visible, 60) << setting;
    EXPECT_LT(visible, 160) << setting;
  }
}

TEST(SimulateWorld, SameSeedGivesTheSameWorld) {
  const Result<World> a = SimulateWorld({}, 3), b = SimulateWorld({}, 3), c = SimulateWorld({}, 4);
  ASSERT_TRUE(a.ok() && b.ok() && c.ok());
  EXPECT_EQ(a->positions, b->positions);
  EXPECT_EQ(a->areas, b->areas);
  EXPECT_NE(a->areas, c->areas);
}

TEST(SimulateWorld, UnknownSettingIsAnError) {
  SimulateWorldsOptions options;
  options.setting = 5;
  EXPECT_EQ(SimulateWorld(options, 0).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace cairn::sim
