#include "stages/reconstruct/verdict/find_loops.h"

#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/reconstruct/verdict/model_of_sights.h"

namespace cairn::reconstruct {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

// A drive of so many images, a metre apart along its way, of which each next one sees 100 points.
Loops LoopsOf(int num_images, std::vector<ModelSight> more, const FindLoopsOptions& options = {},
              std::vector<double> way = {}, const TiedImages& tied = {}) {
  std::vector<ModelSight> sights = SightsOfNext(num_images, 100);
  sights.insert(sights.end(), more.begin(), more.end());
  const ColmapModel model = ModelOfSights(NumberedNames(num_images), PlacesInARow(num_images), sights);
  if (way.empty()) {
    way.resize(num_images);
    std::iota(way.begin(), way.end(), 0);
  }
  return FindLoops(Covisibility(model, AllOfModel(model)), 0, num_images, way, 1, tied, options);
}

//    3---4---5---6       the last image sees again what the first one saw
//    2           7
//    1---0  11 10 8...
TEST(FindLoops, TheDriveThatSeesItsStartAgainIsALoopOfItsWay) {
  const Loops loops = LoopsOf(20, {{{0, 19}, 60}});
  ASSERT_THAT(loops.loops, SizeIs(1));
  EXPECT_EQ(loops.loops[0].image1, 0);
  EXPECT_EQ(loops.loops[0].image2, 19);
  EXPECT_EQ(loops.loops[0].num_points, 60);
  EXPECT_DOUBLE_EQ(loops.loops[0].way, 19);
  EXPECT_THAT(loops.open_stretches, IsEmpty());
}

TEST(FindLoops, ADriveThatGoesStraightOnHasNone) {
  EXPECT_THAT(LoopsOf(20, {}).loops, IsEmpty());
  // Also where it sees far: images of one stretch are in sight of each other all along.
  std::vector<int> all(20);
  std::iota(all.begin(), all.end(), 0);
  const Loops loops = LoopsOf(20, {{all, 200}});
  EXPECT_THAT(loops.loops, IsEmpty());
  EXPECT_THAT(loops.open_stretches, IsEmpty()) << "no loop at all is said once";
}

TEST(FindLoops, FewPointsCloseNoLoop) {
  EXPECT_THAT(LoopsOf(20, {{{0, 19}, 49}}).loops, IsEmpty());
  EXPECT_THAT(LoopsOf(20, {{{0, 19}, 50}}).loops, SizeIs(1));
}

// 0 and 10 see the same, and between them some images that still see a little of it.
TEST(FindLoops, ADriveThatStaysInSightMakesNoLoop) {
  // 1 sees what 0 sees; 2 to 6 are away, five in a row.
  EXPECT_THAT(LoopsOf(11, {{{0, 10}, 60}, {{0, 7}, 5}, {{0, 8}, 5}, {{0, 9}, 5}}).loops, SizeIs(1));
  // 2 to 5 are four in a row, and 7 to 9 three.
  EXPECT_THAT(LoopsOf(11, {{{0, 10}, 60}, {{0, 6}, 5}}).loops, IsEmpty());
  // 6 sees less of it than counts.
  EXPECT_THAT(LoopsOf(11, {{{0, 10}, 60}, {{0, 6}, 4}}).loops, SizeIs(1));
}

TEST(FindLoops, TurningOnTheSpotIsNone) {
  std::vector<double> way(20, 0);
  for (int i = 0; i < 20; ++i) way[i] = 0.5 * i;
  EXPECT_THAT(LoopsOf(20, {{{0, 19}, 60}}, {}, way).loops, IsEmpty()) << "9.5 m, median step 1 m";
  way.back() = 10;
  EXPECT_THAT(LoopsOf(20, {{{0, 19}, 60}}, {}, way).loops, SizeIs(1));
}

// A second lap sees what the first one saw, image by image: that is one loop, and its best pair stands for
// it.
TEST(FindLoops, PairsAlongASecondLapAreOneLoop) {
  std::vector<ModelSight> again;
  for (int i = 0; i < 5; ++i) again.push_back({{i, i + 30}, i == 3 ? 90 : 70});
  const Loops loops = LoopsOf(40, again);
  EXPECT_THAT(loops.pairs, SizeIs(5));
  ASSERT_THAT(loops.loops, SizeIs(1));
  EXPECT_EQ(loops.loops[0].image1, 3);
  EXPECT_EQ(loops.loops[0].image2, 33);
}

TEST(FindLoops, LoopsThatDifferByMoreThanAQuarterOfTheirWayAreTwo) {
  // From 0 back at 40; from 10 and from 11 back at 50: a quarter of 40 is 10.
  EXPECT_THAT(LoopsOf(60, {{{0, 40}, 90}, {{10, 50}, 70}}).loops, SizeIs(1));
  EXPECT_THAT(LoopsOf(60, {{{0, 40}, 90}, {{11, 51}, 70}}).loops, SizeIs(2));
}

TEST(FindLoops, EveryReturnToTheSightOfAnImageCounts) {
  const Loops loops = LoopsOf(60, {{{0, 20}, 60}, {{0, 21}, 80}, {{0, 50}, 70}});
  ASSERT_THAT(loops.pairs, SizeIs(2));
  EXPECT_EQ(loops.pairs[0].image2, 21) << "the best of the first return";
  EXPECT_EQ(loops.pairs[1].image2, 50);
}

// Nothing spans what is before 10 and after 20: ten steps before it, nine after it.
TEST(FindLoops, StretchesThatNoLoopSpansAreOpen) {
  const Loops loops = LoopsOf(30, {{{10, 20}, 60}});
  ASSERT_THAT(loops.open_stretches, SizeIs(1));
  EXPECT_EQ(loops.open_stretches[0].image1, 0);
  EXPECT_EQ(loops.open_stretches[0].image2, 10);
  EXPECT_DOUBLE_EQ(loops.open_stretches[0].length, 10);
  const Loops longer = LoopsOf(60, {{{5, 20}, 60}, {{30, 45}, 60}, {{35, 40}, 60}});
  ASSERT_THAT(longer.open_stretches, SizeIs(2));
  EXPECT_EQ(longer.open_stretches[0].image1, 20);
  EXPECT_EQ(longer.open_stretches[0].image2, 30);
  EXPECT_EQ(longer.open_stretches[1].image1, 45);
  EXPECT_EQ(longer.open_stretches[1].image2, 59);
}

TEST(FindLoops, ALoopWithinALoopOpensNothing) {
  EXPECT_THAT(LoopsOf(45, {{{0, 40}, 60}, {{10, 25}, 60}}).open_stretches, IsEmpty());
}

// Another drive saw 3 and 18, too.
TEST(FindLoops, WhatOtherDrivesHoldIsNotOpen) {
  EXPECT_THAT(LoopsOf(40, {{{10, 25}, 60}}, {}, {}, {3, 18}).open_stretches, SizeIs(1));
  EXPECT_EQ(LoopsOf(40, {{{10, 25}, 60}}, {}, {}, {3, 18}).open_stretches[0].image1, 25);
  const Loops loops = LoopsOf(40, {}, {}, {}, {3, 18});
  EXPECT_THAT(loops.loops, IsEmpty());
  ASSERT_THAT(loops.open_stretches, SizeIs(1));
  EXPECT_EQ(loops.open_stretches[0].image1, 18);
}

}  // namespace
}  // namespace cairn::reconstruct
