// What an open map has, and what it says that its parts take.
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/base/progress.h"
#include "core/blocks/map_blocks.h"
#include "core/files/file.h"
#include "core/plan/views.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/block_cache.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"
#include "runtime/map/open_views.h"
#include "tests/core/map/full_rows.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Landmarks of several blocks.
const std::string& ManyLandmarks() {
  static const std::string path = [] {
    MapRows rows = FullRows();
    rows.visual_map = {};
    Random random(1);
    while (rows.landmarks.size() < 3000) {
      rows.landmarks.push_back(rows.landmarks[0]);
      rows.landmarks.back().class_id = 1'000'000 + static_cast<ClassId>(rows.landmarks.size());
      rows.landmarks.back().position.x() = static_cast<double>(rows.landmarks.size());
    }
    rows.descriptors.conservativeResize(3000, kSiftDescriptorDim);
    for (int i = 0; i < 3000; ++i) rows.descriptors.row(i) = RandomDescriptor(random);
    std::string written = testing::TempDir() + "/open_many.cairn";
    EXPECT_TRUE(WriteMapRows(rows, written).ok());
    return written;
  }();
  return path;
}

TEST(OpenMap, LandmarksAreCountedAsWhatTheyTake) {
  const auto map = *Map::Open(ManyLandmarks());
  ASSERT_GT(map->directory().NumBlocks(BlockKind::kLandmarks), 1);
  for (int64_t block = 0; block < map->directory().NumBlocks(BlockKind::kLandmarks); ++block)
    ASSERT_TRUE(map->Landmarks(block).ok());
  const int64_t of_blocks = map->num_kept_bytes();
  const auto all = map->AllLandmarks().value();
  EXPECT_EQ(all->packed.size(), 3000);
  const int64_t exact = all->idx.size() * sizeof(LandmarkIdx) + all->landmarks.size() * sizeof(MapLandmark) +
                        all->descriptors.num_bytes() + all->packed.num_bytes();
  EXPECT_GE(map->num_kept_bytes() - of_blocks, exact);
  EXPECT_LE(map->num_kept_bytes() - of_blocks, 1.13 * exact);  // what memory that is kept takes more
  EXPECT_EQ(map->AllLandmarks().value(), all);
}

TEST(OpenMap, GatheredLandmarksAreThoseOfTheirBlocksEachOfWhichIsReadOnce) {
  const auto map = *Map::Open(ManyLandmarks(), {.memory_budget_bytes = 0});  // keeps nothing
  const MapRows rows = ReadMapRows(ManyLandmarks()).value();
  std::vector<LandmarkIdx> every_third;
  for (LandmarkIdx i = 0; i < 3000; i += 3) every_third.push_back(i);
  const auto set = map->Gather(every_third, false).value();
  EXPECT_EQ(map->cache().num_loads(), map->directory().NumBlocks(BlockKind::kLandmarks));
  for (const LandmarkIdx landmark : every_third) {
    EXPECT_EQ(set->Find(landmark).class_id, rows.landmarks[landmark].class_id);
    EXPECT_EQ(set->descriptors.row(static_cast<Eigen::Index>(set->Position(landmark))),
              rows.descriptors.row(landmark));
  }
  EXPECT_EQ(set->packed.size(), 0);
  EXPECT_EQ(map->Gather(every_third, true).value()->packed.size(), 1000);
}

TEST(OpenMap, SharedLandmarksAreThoseOfBothLists) {
  const std::vector<LandmarkIdx> a = {1, 3, 4, 7, 9}, b = {0, 3, 5, 7, 8, 9, 12};
  EXPECT_EQ(NumShared(a, b), 3);
  EXPECT_EQ(NumShared(b, a), 3);
  EXPECT_EQ(NumShared(a, a), 5);
  EXPECT_EQ(NumShared(a, {}), 0);
}

//   (0) - [1] - [2]     images 0 | 1 2 | 4; image 3 is of none
MapRows AppearanceRows() {
  MapRows rows = MakeSyntheticRoom(1, 40).rows;
  rows.appearance = {{{0}, false, {{1, 20}}}, {{1, 2}, true, {{2, 30}}}, {{4}, true, {}}};
  rows.appearance[0].look_alikes = {{2, 0.5}};
  for (int node = 0; node < 3; ++node) rows.appearance[node].entropy = 0.25 * node;
  return rows;
}

TEST(OpenMap, AppearanceIsThatOfTheNodes) {
  const auto map = *Map::FromRows(AppearanceRows());
  const auto appearance = map->Appearance().value();
  EXPECT_EQ(appearance->num_kept_images, 3);
  EXPECT_THAT(appearance->is_kept, ElementsAre(0, 1, 1));
  EXPECT_THAT(std::vector(appearance->node_of_image.begin(), appearance->node_of_image.begin() + 6),
              ElementsAre(0, 1, 1, -1, 2, -1));
  EXPECT_THAT(appearance->graph.Links(), ElementsAre(AppearanceLink{0, 1, 20}, AppearanceLink{1, 2, 30}));
  EXPECT_THAT(appearance->entropy, ElementsAre(0, 0.25, 0.5));
  EXPECT_EQ(appearance->look_alikes[2][0].node, 0);
  EXPECT_EQ(map->Appearance().value(), appearance);
  // A map need not say how well its places can be told apart.
  MapRows rows = AppearanceRows();
  for (MapAppearanceNode& node : rows.appearance) {
    node.entropy.reset();
    node.look_alikes.clear();
  }
  EXPECT_TRUE((*Map::FromRows(rows))->Appearance().value()->entropy.empty());
}

TEST(OpenMap, AppearanceIsCountedAsWhatItTakes) {
  const auto map = *Map::FromRows(AppearanceRows());
  const auto appearance = map->Appearance().value();
  AppearanceBlock nodes;
  nodes.nodes = AppearanceRows().appearance;
  AmbiguityBlock ambiguity;
  ambiguity.nodes = {{0, {{2, 0.5}}}, {0.25, {}}, {0.5, {}}};
  // Two ends of each of 2 links, 3 nodes with the lists of their 4 images, the node of each image.
  const int64_t expected = NumBytes(nodes) + NumBytes(ambiguity) + 2 * 2 * 8 + 3 * (1 + 24 + 8) +
                           static_cast<int64_t>(appearance->node_of_image.size()) * 2 * 4 + 3 * 8 + 3 * 24;
  EXPECT_EQ(map->num_kept_bytes(), expected);
}

TEST(OpenMap, PlanAndItsRegionsAreCountedAsWhatTheyTake) {
  const auto map = *Map::FromRows(FullRows());
  ASSERT_TRUE(map->has_floor_plan());
  const auto views = map->Plan().value();
  ASSERT_EQ(views->num_faces(), 2);
  // The plan twice, as a block and with the regions, and the regions.  Counted on: 2 regions of 4 corners
  // each, with 4 + 1 labels and one link, on 6 vertices.
  const int64_t plan = NumBytes(views->plan);
  const auto regions =
      static_cast<int64_t>(6 * sizeof(GridPoint) + 8 * 4 + 2 * sizeof(ViewIndex) + sizeof(ViewLink) + 5 * 4);
  EXPECT_GE(map->num_kept_bytes(), 2 * (plan + regions));
  EXPECT_LE(map->num_kept_bytes(), 2 * (plan + regions) + 600);
  NoProgress progress;
  EXPECT_EQ(map->FloorViews(1, 1000, progress).value(), views);
}

TEST(OpenMap, WhatAMapHasNot) {
  MapRows rows = FullRows();
  EXPECT_TRUE(Map::FromRows(rows).value()->has_visual_map());
  EXPECT_EQ(Map::FromRows(rows).value()->LandmarkModels().value().landmarks.size(), 3U);
  rows.views = {};
  rows.visual_map = {};
  rows.vocabulary = {};
  const auto map = *Map::FromRows(rows);
  EXPECT_FALSE(map->has_floor_plan());
  EXPECT_FALSE(map->has_visual_map());
  EXPECT_FALSE(map->has_words());
  EXPECT_EQ(map->Plan().error().code, ErrorCode::kNotFound);
  EXPECT_EQ(map->LandmarkModels().error().code, ErrorCode::kNotFound);
}

TEST(OpenMap, PlanIsReadFromAMapButFromNoOtherFile) {
  const std::string path = testing::TempDir() + "/open_plan.cairn";
  ASSERT_TRUE(WriteMapRows(FullRows(), path).ok());
  EXPECT_EQ(OpenPlan(path).value()->num_faces(), 2);
  NoProgress progress;
  EXPECT_EQ(OpenViews(path, 1, 1000, progress).value()->num_faces(), 2);
  MapRows bare = FullRows();
  bare.views = {};
  ASSERT_TRUE(WriteMapRows(bare, path).ok());
  const Error none = OpenPlan(path).error();
  EXPECT_EQ(none.code, ErrorCode::kNotFound);
  EXPECT_THAT(none.message, HasSubstr(path));
  // The head of a map says what it is; of what has not even that, reading it as views says why.
  const std::string head = ReadFile(path).value().substr(0, 72);
  ASSERT_TRUE(WriteFileAtomically(path, head).ok());
  EXPECT_THAT(OpenPlan(path).error().message, HasSubstr("has 72 bytes, but should have"));
  for (const std::string& other : {head.substr(0, 71), std::string(100, 'x')}) {
    ASSERT_TRUE(WriteFileAtomically(path, other).ok());
    EXPECT_EQ(OpenPlan(path).error().message, ReadViews(path).error().message);
  }
}

TEST(OpenMap, TenSizesOfCamerasAreNamed) {
  MapRows rows = MakeSyntheticRoom(1, 40).rows;
  for (int i = 1; i < 12; ++i) {
    rows.cameras.push_back(rows.cameras[0]);
    rows.cameras.back().camera_id = 1 + i;
    rows.cameras.back().width = 600 + i;
  }
  const auto map = *Map::FromRows(rows);
  EXPECT_EQ(map->CameraForSize(605, 480)->camera_id, 6U);
  EXPECT_EQ(map->CameraForSize(605, 481).error().code, ErrorCode::kNotFound);
  const std::string message = map->CameraForSize(700, 480).error().message;
  EXPECT_THAT(message, HasSubstr("no cameras of map"));
  EXPECT_THAT(message, HasSubstr("609 x 480"));
  EXPECT_THAT(message, testing::Not(HasSubstr("610 x 480")));
}

TEST(BlockCache, FillsItsBudgetToTheLastByte) {
  BlockCache cache(100);
  const auto block = std::make_shared<const int>(1);
  cache.Insert(1, block, 60);
  cache.Insert(2, block, 40);
  EXPECT_EQ(cache.num_blocks(), 2);
  EXPECT_EQ(cache.num_bytes(), 100);
  cache.Insert(3, block, 1);
  EXPECT_EQ(cache.num_blocks(), 2);
  EXPECT_EQ(cache.num_bytes(), 41);
  EXPECT_EQ(cache.num_loads(), 3);
}

TEST(BlockCache, FirstOfTwoThatAreInsertedStays) {
  BlockCache cache(100);
  const auto first = cache.Insert(1, std::make_shared<const int>(1), 10);
  EXPECT_EQ(cache.Insert(1, std::make_shared<const int>(2), 10), first);
  EXPECT_EQ(cache.num_loads(), 1);
  EXPECT_EQ(cache.num_bytes(), 10);
}

}  // namespace
}  // namespace cairn
