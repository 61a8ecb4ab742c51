// Blocks of the floor plan and its regions put together by hand, with numbers at the limits of what they may
// be and beyond.
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_blocks.h"
#include "core/blocks/map_layout.h"
#include "tests/core/blocks/page_bytes.h"
#include "tests/core/map/example.h"

namespace cairn {
namespace {

using testing::HasSubstr;

using BlockParts = std::vector<std::string>;

std::string F64(double value) {
  BlobWriter writer;
  writer.Float64(value);
  return writer.Take();
}

std::string Joined(const BlockParts& parts) {
  std::string bytes;
  for (const std::string& part : parts) bytes += part;
  return bytes;
}

// The plan of MakeExampleViews: a room of 200 x 100 units of 1 cm.
BlockParts PlanParts() {
  const FloorPlan plan = MakeExampleViews().plan;
  BlockParts parts = {F64(0.01) + F64(-1) + F64(0.5), U8(1), Z(0) + Z(0), Z(200) + Z(100), V(4)};
  parts.push_back(Z(-200) + Z(-100) + Z(200) + Z(0) + Z(0) + Z(100) + Z(-200) +
                  Z(0));  // 5: steps from the corner before
  for (size_t i = 0; i < 4; ++i) {
    const PlanWall& wall = plan.walls[i];
    parts.push_back(F64(wall.start.x()) + F64(wall.start.y()) + F64(wall.end.x()) + F64(wall.end.y()));
    parts.push_back(V(1));
    parts.push_back(Z(0) + Z(i == 3 ? -3 : 1));  // 8, 11, 14, 17: where the piece before ended, and its end
  }
  return parts;
}

Result<FloorPlan> DecodePlan(const BlockParts& parts) {
  return DecodeFloorPlan(Joined(parts), EntryOf(BlockKind::kFloorPlan, 0, 4), {}, "block");
}

std::string PlanRefusal(size_t part, const std::string& bytes) {
  BlockParts parts = PlanParts();
  parts[part] = bytes;
  return RefusalOf(DecodePlan(parts));
}

TEST(PlanLimits, BytesAreReadAsThePageDrawsThem) {
  const FloorPlan plan = MakeExampleViews().plan;
  EXPECT_EQ(EncodeFloorPlan(plan), Joined(PlanParts()));
  const Result<FloorPlan> read = DecodePlan(PlanParts());
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(EncodeFloorPlan(*read), EncodeFloorPlan(plan));
  EXPECT_EQ(read->grid_m, 0.01);
  EXPECT_EQ(read->origin, Eigen::Vector2d(-1, 0.5));
  EXPECT_TRUE(read->closed);
  EXPECT_EQ(read->vertices, plan.vertices);
  EXPECT_EQ(read->pieces[3].start, 3);
  EXPECT_EQ(read->pieces[3].end, 0);
  EXPECT_EQ(read->pieces[3].wall, 3);
}

TEST(PlanLimits, NumbersAreInRange) {
  EXPECT_THAT(PlanRefusal(1, U8(2)), HasSubstr("its head makes no sense"));
  EXPECT_THAT(PlanRefusal(4, V(100'000)), HasSubstr("its head makes no sense"));
  EXPECT_THAT(PlanRefusal(4, V(3)), HasSubstr("block"));
  EXPECT_THAT(PlanRefusal(8, Z(-1) + Z(1)), HasSubstr("its bytes are not those of 4 walls"));
  EXPECT_THAT(PlanRefusal(8, Z(4) + Z(1)), HasSubstr("its bytes are not those of 4 walls"));
  EXPECT_THAT(PlanRefusal(17, Z(0) + Z(1)), HasSubstr("its bytes are not those of 4 walls"));
  EXPECT_THAT(PlanRefusal(7, V(1'000)), HasSubstr("wall 0 has 1000 pieces"));
  EXPECT_THAT(PlanRefusal(17, Z(0) + Z(-3) + 'x'), HasSubstr("its bytes are not those of 4 walls"));
  // Beyond the grid, at once or step by step.
  const int64_t beyond = kMaxGridCoordinate + 1;
  for (const int64_t sign : {1, -1}) {
    EXPECT_THAT(PlanRefusal(2, Z(sign * beyond) + Z(0)), HasSubstr("block"));
    EXPECT_THAT(PlanRefusal(2, Z(0) + Z(sign * beyond)), HasSubstr("block"));
    EXPECT_THAT(PlanRefusal(2, Z(sign * (int64_t{1} << 61)) + Z(0)), HasSubstr("block"));
  }
}

// The two regions of MakeExampleViews.
BlockParts RegionParts() {
  const std::string index = F32(6) + F32(6) + F32(2) + F32(2);
  return {
      V(0),  // no vertices before
      V(4),  // 1: corners, all new
      V(0) + Z(0) + Z(0) + V(0) + Z(100) + Z(0) + V(0) + Z(0) + Z(100) + V(0) + Z(-100) + Z(0),  //
      V(0),                                                          // 3: no more vertices
      V(0),                                                          // 4: no parent
      V(4) + V(0) + V(0) + V(0) + V(0),                              // 5: labels 0, 2, 4, 6
      V(4),                                                          // 6: so many labels
      index,                                                         //
      V(1),                                                          // 8: a neighbour,
      V(1),                                                          // 9: the next,
      V(3) + V(2),                                                   // 10: behind vertices 1 and 2 of 4
      V(4),                                                          // 11
      V(3) + V(0) + Z(200) + Z(-100) + V(0) + Z(0) + Z(100) + V(4),  // 12: 1, two new ones, 2 of 6
      V(0),                                                          // 13
      V(1),                                                          // 14: of the one before
      V(1) + V(4),                                                   // 15: label 2
      V(3),
      F32(5) + F32(5) + F32(1.5F) + F32(2),
      V(0),  // 16 to 18: no neighbours
  };
}

Result<ViewBlock> DecodeRegions(const BlockParts& parts) {
  const MapDirectory directory = DirectoryOf({{BlockKind::kFloorPlan, 4}, {BlockKind::kViewRegions, 2}});
  return DecodeViewBlock(Joined(parts), EntryOf(BlockKind::kViewRegions, 0, 2), directory, "block");
}

std::string RegionRefusal(size_t part, const std::string& bytes) {
  BlockParts parts = RegionParts();
  parts[part] = bytes;
  return RefusalOf(DecodeRegions(parts));
}

TEST(ViewRegionLimits, BytesAreReadAsThePageDrawsThem) {
  MapRows rows;
  rows.views = MakeExampleViews();
  const MapLayout layout(rows);
  EXPECT_EQ(layout.Encode(EntryOf(BlockKind::kViewRegions, 0, 2)), Joined(RegionParts()));
  const Result<ViewBlock> block = DecodeRegions(RegionParts());
  ASSERT_TRUE(block.ok()) << block.error().message;
  Views read;
  ASSERT_TRUE(AppendRegions(*block, "block", &read).ok());
  EXPECT_EQ(read.vertices, rows.views.vertices);
  EXPECT_EQ(read.face_vertices, rows.views.face_vertices);
  EXPECT_EQ(read.parents, rows.views.parents);
  EXPECT_EQ(read.toggled_labels, rows.views.toggled_labels);
  EXPECT_EQ(read.links, rows.views.links);
  EXPECT_EQ(read.index[1].num_labels, 3);
  EXPECT_EQ(read.index[1].wall_length_m, 5);
  EXPECT_EQ(read.index[1].visible_area_m2, 1.5F);
}

TEST(ViewRegionLimits, NumbersAreInRange) {
  const auto first = HasSubstr("region 0 of the floor plan makes no sense");
  const auto second = HasSubstr("region 1 of the floor plan makes no sense");
  EXPECT_THAT(RegionRefusal(0, V(2147483648)), HasSubstr("2147483648 vertices come before it"));
  EXPECT_THAT(RegionRefusal(0, V(2147483647)), first);  // none can follow
  EXPECT_THAT(RegionRefusal(1, V(2)), first);
  EXPECT_THAT(RegionRefusal(1, V(100'000)), first);
  EXPECT_THAT(RegionRefusal(3, V(100'000)), first);
  EXPECT_THAT(RegionRefusal(4, V(1)), first);  // there is none before
  EXPECT_THAT(RegionRefusal(14, V(2)), second);
  EXPECT_EQ(RegionRefusal(14, V(0)), "");
  EXPECT_EQ(RegionRefusal(15, RunOf(7)), "");
  EXPECT_THAT(RegionRefusal(15, RunOf(8)), second);
  EXPECT_EQ(RegionRefusal(16, V(8)), "");
  EXPECT_THAT(RegionRefusal(16, V(9)), second);
  EXPECT_THAT(RegionRefusal(8, V(100'000)), first);
  EXPECT_THAT(RegionRefusal(9, V(0)), first);
  EXPECT_THAT(RegionRefusal(9, V(2)), first);
  EXPECT_EQ(RegionRefusal(10, V(4) + V(1)), "");
  EXPECT_THAT(RegionRefusal(10, V(5) + V(1)), first);
  EXPECT_THAT(RegionRefusal(18, V(0) + 'x'), HasSubstr("bytes are left after 2 regions"));
  // Corners at the end of the grid, and beyond it.
  const auto corners = [](int64_t x) {
    return V(0) + Z(x) + Z(0) + V(0) + Z(0) + Z(0) + V(0) + Z(0) + Z(0) + V(0) + Z(-x) + Z(0);
  };
  EXPECT_EQ(RegionRefusal(2, corners(kMaxGridCoordinate)), "");
  EXPECT_EQ(RegionRefusal(2, corners(-kMaxGridCoordinate)), "");
  EXPECT_THAT(RegionRefusal(2, corners(kMaxGridCoordinate + 1)), first);
  EXPECT_THAT(RegionRefusal(2, corners(-kMaxGridCoordinate - 1)), first);
}

}  // namespace
}  // namespace cairn
