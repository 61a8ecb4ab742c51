#include "runtime/atlas/atlas_route.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/runtime/atlas/three_rooms.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Rooms in which images 0, 1, 2, 3 and 4 lie along a way, each linked to the next.
class AtlasRouteTest : public ThreeRoomsTest {
 protected:
  static void SetUpTestSuite() {
    for (int room = 0; room < kNumRooms; ++room) {
      MapRows rows = Room(room).rows;
      rows.name = "room " + std::to_string(room);
      for (int32_t node = 0; node < 5; ++node) {
        rows.appearance.push_back({.images = {node}, .is_kept = true});
        if (node < 4) rows.appearance.back().links = {{node + 1, 20}};
      }
      ASSERT_TRUE(WriteMapRows(rows, Path(std::to_string(room) + ".cairn")).ok());
    }
  }
};

std::vector<std::vector<int32_t>> ImagesOf(const std::vector<AtlasLeg>& legs) {
  std::vector<std::vector<int32_t>> images;
  for (const AtlasLeg& leg : legs) images.push_back(leg.route.images);
  return images;
}

TEST_F(AtlasRouteTest, LeadsThroughTheRoomAlone) {
  const auto legs = PlanRoute(*Open(Rows()), {1, 0}, {1, 3});
  ASSERT_TRUE(legs.ok()) << legs.error().message;
  EXPECT_THAT(ImagesOf(*legs), ElementsAre(ElementsAre(0, 1, 2, 3)));
  EXPECT_EQ((*legs)[0].map, 1);
  EXPECT_EQ((*legs)[0].passage, "");
  EXPECT_THAT(ImagesOf(*PlanRoute(*Open(Rows()), {1, 2}, {1, 2})), ElementsAre(ElementsAre(2)));
}

TEST_F(AtlasRouteTest, TakesTheCheapestPassages) {
  AtlasRows rows = Rows();
  rows.passages = {{.name = "stairs", .from = {0, 4}, .to = {2, 0}, .cost = 5},
                   {.name = "lift", .from = {0, 1}, .to = {1, 0}, .cost = 1},
                   {.name = "bridge", .from = {2, 1}, .to = {1, 2}, .cost = 1}};
  // By the stairs 4 + 5 + 2 links; by lift and bridge 1 + 1 + 2 + 1 + 1: room 1 is gone through, and the
  // bridge back from its end.
  const auto legs = PlanRoute(*Open(rows), {0, 0}, {2, 2});
  ASSERT_TRUE(legs.ok()) << legs.error().message;
  ASSERT_EQ(legs->size(), 3u);
  EXPECT_THAT(ImagesOf(*legs), ElementsAre(ElementsAre(0, 1), ElementsAre(0, 1, 2), ElementsAre(1, 2)));
  EXPECT_EQ((*legs)[0].passage, "lift");
  EXPECT_EQ((*legs)[1].map, 1);
  EXPECT_EQ((*legs)[1].passage, "bridge");
  EXPECT_EQ((*legs)[2].passage, "");
  // A slow lift, and the stairs are cheaper.
  rows.passages[1].cost = 50;
  const auto by_stairs = *PlanRoute(*Open(rows), {0, 0}, {2, 2});
  ASSERT_EQ(by_stairs.size(), 2u);
  EXPECT_EQ(by_stairs[0].passage, "stairs");
  EXPECT_THAT(ImagesOf(by_stairs), ElementsAre(ElementsAre(0, 1, 2, 3, 4), ElementsAre(0, 1, 2)));
}

TEST_F(AtlasRouteTest, APassageMayBeShorterThanTheRoomItself) {
  AtlasRows rows = Rows();
  rows.passages = {{.name = "door", .from = {0, 0}, .to = {0, 4}, .cost = 0.5}};
  const auto legs = *PlanRoute(*Open(rows), {0, 0}, {0, 3});
  EXPECT_THAT(ImagesOf(legs), ElementsAre(ElementsAre(0), ElementsAre(4, 3)));
  EXPECT_EQ(legs[0].passage, "door");
}

TEST_F(AtlasRouteTest, SaysWhereNothingLeads) {
  AtlasRows rows = Rows();
  const auto code_of = [](const auto& result) { return result.error().code; };
  auto none = PlanRoute(*Open(rows), {0, 0}, {1, 0});
  EXPECT_EQ(code_of(none), ErrorCode::kNotFound);
  EXPECT_THAT(none.error().message, HasSubstr("no passages lead from map 'room 0' to map 'room 1'"));
  // Image 5 is of no node: what the map itself says of it.
  none = PlanRoute(*Open(rows), {0, 0}, {0, 5});
  EXPECT_EQ(code_of(none), ErrorCode::kNotFound);
  EXPECT_THAT(none.error().message, HasSubstr("survey5"));
  EXPECT_EQ(code_of(PlanRoute(*Open(rows), {0, 0}, {3, 0})), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code_of(PlanRoute(*Open(rows), {-1, 0}, {0, 0})), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code_of(PlanRoute(*Open(rows), {0, 0}, {0, 5000})), ErrorCode::kInvalidArgument);
}

TEST_F(AtlasRouteTest, ImagesAreNamedByTheirMaps) {
  AtlasRows rows = Rows();
  const auto atlas = Open(rows);
  EXPECT_EQ(*FindImage(*atlas, "room 2/survey7"), (AtlasImage{2, 7}));
  EXPECT_EQ(FindImage(*atlas, "room 2/none").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(FindImage(*atlas, "room 4/survey7").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(FindImage(*atlas, "survey7").error().code, ErrorCode::kNotFound);
}

// Names of maps may be the beginnings of others: the longest counts, wherever it stands.
TEST_F(AtlasRouteTest, ImagesAreOfTheMapWithTheLongestName) {
  AtlasRows rows;
  for (const char* name : {"hall/east", "hall", "hall/east/up"}) rows.maps.push_back({.name = name});
  EXPECT_EQ(MapOfImage(rows, "hall/east/7.jpg").value(), 0);
  EXPECT_EQ(MapOfImage(rows, "hall/7.jpg").value(), 1);
  EXPECT_EQ(MapOfImage(rows, "hall/east/up/7.jpg").value(), 2);
  EXPECT_EQ(MapOfImage(rows, "hall/eastern/7.jpg").value(), 1);
  EXPECT_FALSE(MapOfImage(rows, "hallway/7.jpg").ok());
}

}  // namespace
}  // namespace cairn
