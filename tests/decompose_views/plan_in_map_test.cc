// A map that has only the walls of its floor plan.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/plan/views.h"
#include "runtime/map/map.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/full_rows.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn {
namespace {

using testing::HasSubstr;

constexpr char kFlat[] = "0,0,6,0\n6,0,6,4\n6,4,0,4\n0,4,0,0\n3.5,0,3.5,1.5\n3.5,2.5,3.5,4\n";

std::shared_ptr<const Map> MapWith(const Views& views, bool regions) {
  MapRows rows = FullRows();
  EXPECT_TRUE(emit_map::AddViews(views, regions, &rows).ok());
  const std::string path = testing::TempDir() + "plan_in_map.cairn";
  EXPECT_TRUE(WriteMapRows(rows, path).ok());
  auto map = Map::Open(path);
  EXPECT_TRUE(map.ok());
  return *map;
}

Result<std::shared_ptr<const Views>> Regions(const Map& map) {
  NoProgress progress;
  return map.FloorViews(/*num_threads=*/2, /*memory_mib=*/4096, progress);
}

void ExpectSameRegions(const Views& found, const Views& expected) {
  ASSERT_EQ(found.num_faces(), expected.num_faces());
  for (FaceIdx face = 0; face < found.num_faces(); ++face) {
    EXPECT_EQ(found.LabelSet(face), expected.LabelSet(face)) << face;
    EXPECT_EQ(found.Centroid(face), expected.Centroid(face)) << face;
    EXPECT_EQ(found.index[face].visible_area_m2, expected.index[face].visible_area_m2);
  }
  EXPECT_EQ(found.links.size(), expected.links.size());
}

TEST(PlanInMap, RegionsAreDerivedWhereTheyAreAskedFor) {
  const Views whole = decompose_views::Decomposed(kFlat).views;
  ASSERT_GT(whole.num_faces(), 10);
  const auto map = MapWith(whole, /*regions=*/false);
  EXPECT_TRUE(map->has_floor_plan());
  const auto plan = map->Plan();
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  EXPECT_EQ((*plan)->num_faces(), 0);
  ASSERT_EQ((*plan)->plan.num_walls(), whole.plan.num_walls());
  EXPECT_EQ((*plan)->plan.walls[4].end, whole.plan.walls[4].end);
  const auto views = Regions(*map);
  ASSERT_TRUE(views.ok()) << views.error().message;
  ExpectSameRegions(**views, whole);
  EXPECT_EQ(Regions(*map)->get(), views->get()) << "derived once";
  NoProgress progress;
  const auto too_large = MapWith(whole, false)->FloorViews(1, 0, progress);
  EXPECT_EQ(too_large.error().code, ErrorCode::kNoMemory);
  EXPECT_THAT(too_large.error().message, HasSubstr("view boundaries"));
}

TEST(PlanInMap, StoredRegionsAreThoseThatAreGiven) {
  const Views whole = decompose_views::Decomposed(kFlat).views;
  const auto map = MapWith(whole, /*regions=*/true);
  EXPECT_GT((*map->Plan())->num_faces(), 10);
  ExpectSameRegions(**Regions(*map), whole);
  EXPECT_EQ(Regions(*map)->get(), map->Plan()->get());
}

TEST(PlanInMap, DerivedRegionsAreCountedAsWhatTheyTake) {
  const auto map = MapWith(decompose_views::Decomposed(kFlat).views, /*regions=*/false);
  ASSERT_TRUE(map->Plan().ok());
  const int64_t before = map->num_kept_bytes();
  const auto found = *Regions(*map);
  const auto list = [](const auto& values) {
    return static_cast<int64_t>(values.size() * sizeof(values.front()));
  };
  const int64_t taken = list(found->vertices) + list(found->face_offsets) + list(found->face_vertices) +
                        list(found->parents) + list(found->toggle_offsets) + list(found->toggled_labels) +
                        list(found->index) + list(found->links) + list(found->plan.vertices) +
                        list(found->plan.pieces) + list(found->plan.walls);
  EXPECT_EQ(map->num_kept_bytes() - before, taken + static_cast<int64_t>(sizeof(Views) + sizeof(FloorPlan)));
}

TEST(PlanInMap, AMapWithoutAPlanSaysSo) {
  MapRows rows = FullRows();
  rows.views = {};
  const auto map = Map::FromRows(rows);
  ASSERT_TRUE(map.ok());
  EXPECT_FALSE((*map)->has_floor_plan());
  EXPECT_EQ((*map)->Plan().error().code, ErrorCode::kNotFound);
  EXPECT_EQ(Regions(**map).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace cairn
