#include "stages/reconstruct/view_graph/backbone.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::reconstruct {
namespace {

using testing::ElementsAre;

ViewPair Pair(int image1, int image2, double strength) {
  ViewPair pair;
  pair.image1 = image1;
  pair.image2 = image2;
  pair.strength = strength;
  pair.matches.resize(50);
  return pair;
}

std::vector<ViewPair> MakeDrive(int num_images, double strength) {
  std::vector<ViewPair> pairs;
  for (int i = 0; i + 1 < num_images; ++i) pairs.push_back(Pair(i, i + 1, strength));
  return pairs;
}

TEST(IsDrive, WhereMostImagesShowWhatTheNextOneShows) {
  std::vector<ViewPair> pairs = MakeDrive(11, 0.4);
  EXPECT_TRUE(IsDrive(11, pairs, {}));
  pairs[3].strength = pairs[7].strength = 0.39;
  EXPECT_TRUE(IsDrive(11, pairs, {}));  // 8 of 10
  pairs[5].strength = 0.1;
  EXPECT_FALSE(IsDrive(11, pairs, {}));
  EXPECT_FALSE(IsDrive(5, {Pair(0, 2, 1), Pair(1, 3, 1), Pair(2, 4, 1)}, {}));
}

TEST(SetWeights, OfADriveFallWithTheDistanceUpToTen) {
  std::vector<ViewPair> pairs = {Pair(0, 1, 0.8), Pair(4, 0, 0.8), Pair(0, 10, 0.8), Pair(0, 50, 0.8)};
  SetWeights(true, &pairs);
  EXPECT_DOUBLE_EQ(pairs[0].weight, 0.8);
  EXPECT_DOUBLE_EQ(pairs[1].weight, 0.2);
  EXPECT_DOUBLE_EQ(pairs[2].weight, 0.08);
  EXPECT_DOUBLE_EQ(pairs[3].weight, 0.08);
  // A relative pose of few matches is doubtful.
  pairs[1].matches.resize(25);
  SetWeights(true, &pairs);
  EXPECT_DOUBLE_EQ(pairs[1].weight, 0.1);
  // So is one that may have another rotation.
  pairs[2].alternatives.resize(1);
  SetWeights(true, &pairs);
  EXPECT_DOUBLE_EQ(pairs[2].weight, 0.024);
  SetWeights(false, &pairs);
  EXPECT_DOUBLE_EQ(pairs[1].weight, 0.4);
  EXPECT_DOUBLE_EQ(pairs[3].weight, 0.8);
}

TEST(Backbone, WithoutAnOrderItIsTheStrongPairs) {
  const std::vector<ViewPair> pairs = {Pair(0, 1, 0.9), Pair(1, 2, 0.1), Pair(0, 2, 0.099), Pair(2, 3, 0.7)};
  EXPECT_THAT(Backbone(4, pairs, {}, false), ElementsAre(0, 1, 3));
}

TEST(Backbone, WithoutAnOrderPairsThatOthersDoNotBearOutAreWeak) {
  std::vector<ViewPair> pairs = {Pair(0, 1, 0.9), Pair(1, 2, 0.5), Pair(0, 2, 0.9), Pair(2, 3, 0.7)};
  pairs[2].closed = 0.1;
  EXPECT_THAT(Backbone(4, pairs, {}, false), ElementsAre(0, 1, 3));
  SetWeights(false, &pairs);
  EXPECT_DOUBLE_EQ(pairs[1].weight, 0.5);
  EXPECT_DOUBLE_EQ(pairs[2].weight, 0.09);
}

TEST(Backbone, PartsAreJoinedByTheStrongestOfTheWeakPairs) {
  // Two parts; the strongest pairs between them come, with those of nearly its strength, and the weak ones do
  // not.
  const std::vector<ViewPair> pairs = {Pair(0, 1, 0.9),   Pair(2, 3, 0.9),  Pair(0, 2, 0.062),
                                       Pair(1, 3, 0.054), Pair(1, 2, 0.02), Pair(0, 3, 0.049)};
  EXPECT_THAT(Backbone(4, pairs, {}, false), ElementsAre(0, 1, 2, 3));
  // Weak as it may be, within reason.
  EXPECT_THAT(Backbone(3, {Pair(0, 1, 0.9), Pair(1, 2, 0.006)}, {}, false), ElementsAre(0, 1));
  EXPECT_THAT(Backbone(3, {Pair(0, 1, 0.9), Pair(1, 2, 0.004)}, {}, false), ElementsAre(0));
}

TEST(Backbone, OfADriveItIsWhatIsNearInItsOrder) {
  std::vector<ViewPair> pairs = MakeDrive(30, 0.1);
  pairs.push_back(Pair(3, 13, 0.25));  // 29: near enough
  pairs.push_back(Pair(3, 14, 0.9));   // 30: a loop, however strong
  pairs.push_back(Pair(5, 7, 0.24));   // 31: too weak
  const std::vector<int> backbone = Backbone(30, pairs, {}, true);
  EXPECT_EQ(backbone.size(), 30u);
  EXPECT_EQ(backbone.back(), 29);
  // Where the order breaks, what joins is taken.
  pairs.erase(pairs.begin() + 10);  // 10 - 11; now (3, 13) is 28 and (3, 14) is 29
  pairs[28].strength = 0.1;
  EXPECT_EQ(Backbone(30, pairs, {}, true).back(), 29);
}

TEST(IsDrive, WhereOdometrySaysHowTheNextImageWasReached) {
  std::vector<ViewPair> pairs = MakeDrive(11, 0.4);
  pairs.resize(5);
  std::vector<ImageMotion> motions;
  for (int i = 6; i < 9; ++i) motions.push_back({i + 1, i, {}});
  EXPECT_TRUE(IsDrive(11, pairs, motions));  // 8 of 10
  motions[2] = {6, 8, {}};
  EXPECT_FALSE(IsDrive(11, pairs, motions));
  motions[2] = {2, 3, {}};  // one that a pair joins, too
  EXPECT_FALSE(IsDrive(11, pairs, motions));
}

TEST(Backbone, WhatMotionsJoinNeedsNoWeakPair) {
  const std::vector<ViewPair> pairs = {Pair(0, 1, 0.9), Pair(2, 3, 0.9), Pair(0, 3, 0.05)};
  EXPECT_THAT(Backbone(4, pairs, {}, false), ElementsAre(0, 1, 2));
  EXPECT_THAT(Backbone(4, pairs, {{1, 2, {}}}, false), ElementsAre(0, 1));
}

}  // namespace
}  // namespace cairn::reconstruct
