#include "stages/match_features/select_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::Pair;

// A camera at (x, 0, 0) that looks along z, turned by `yaw_deg` about y.
PosedCamera At(double x, double yaw_deg) {
  PosedCamera image;
  image.camera.model = CameraModel::kSimplePinhole;
  image.camera.width = 640;
  image.camera.height = 480;
  image.camera.params = {500, 320, 240};
  image.cam_from_world.rotation = Eigen::AngleAxisd(RadFromDeg(yaw_deg), Eigen::Vector3d::UnitY());
  image.cam_from_world.translation = image.cam_from_world.rotation * Eigen::Vector3d(-x, 0, 0);
  return image;
}

TEST(SelectPairs, ExhaustiveAndSequencePairsAreAscending) {
  EXPECT_THAT(ExhaustivePairs(3), ElementsAre(Pair(0, 1), Pair(0, 2), Pair(1, 2)));
  EXPECT_THAT(SequencePairs({0, 1, 2, 3}, 1), ElementsAre(Pair(0, 1), Pair(1, 2), Pair(2, 3)));
  EXPECT_TRUE(ExhaustivePairs(1).empty());
  EXPECT_TRUE(ExhaustivePairs(0).empty());
}

TEST(SelectPairs, SequenceFollowsNumbersInNames) {
  EXPECT_THAT(NaturalOrder({"1.jpg", "10.jpg", "2.jpg"}), ElementsAre(0, 2, 1));
  EXPECT_THAT(NaturalOrder({"b/1.png", "a/12.png", "a/012.png", "a/3.png", "a"}), ElementsAre(4, 3, 1, 2, 0));
  EXPECT_THAT(SequencePairs(NaturalOrder({"1.jpg", "10.jpg", "2.jpg"}), 1),
              ElementsAre(Pair(0, 2), Pair(1, 2)));
}

OverlapRanking Rank(const std::vector<PosedCamera>& images) {
  NoProgress progress;
  return *RankOverlaps(images, {}, 2, progress);
}

TEST(SelectPairs, FrustaThatShareSceneAreMatchedOthersAreNot) {
  //  0 and 1 side by side, both ahead; 2 looks backwards; 3 is far away
  const std::vector<PosedCamera> images = {At(0, 0), At(0.3, 0), At(0, 180), At(50, 0)};
  EXPECT_THAT(FrustumPairs(Rank(images)), ElementsAre(Pair(0, 1)));
}

TEST(SelectPairs, SeedsAreThePartnersOfLargestOverlap) {
  //  0 . 1 2 . . 3    all look ahead, 0.2 m a mark: the nearest is the one of largest overlap
  const std::vector<PosedCamera> images = {At(0, 0), At(0.4, 0), At(0.6, 0), At(1.2, 0)};
  const OverlapRanking ranking = Rank(images);
  ASSERT_EQ(ranking[1].size(), 3u);
  EXPECT_EQ(ranking[1][0].idx, 2);
  EXPECT_GT(ranking[1][0].overlap, ranking[1][1].overlap);
  EXPECT_THAT(FrustumSeeds(ranking, 1, 0), ElementsAre(Pair(0, 1), Pair(1, 2), Pair(2, 3)));
  EXPECT_TRUE(FrustumSeeds(ranking, 0, 0).empty());
}

TEST(SelectPairs, ScoutsStandAtEvenDistancesInTheOtherRanks) {
  //  partners of image 0 by rank    1 2 | 3 4 5 6 7 8
  //  two seeds, two scouts          # # |   #     #       the middles of both halves of the rest
  //  two seeds, one scout           # # |       #
  OverlapRanking ranking(9);
  for (int i = 1; i < 9; ++i) ranking[0].push_back({i, 1.0F / static_cast<float>(i)});
  EXPECT_THAT(FrustumSeeds(ranking, 2, 2), ElementsAre(Pair(0, 1), Pair(0, 2), Pair(0, 4), Pair(0, 7)));
  EXPECT_THAT(FrustumSeeds(ranking, 2, 1), ElementsAre(Pair(0, 1), Pair(0, 2), Pair(0, 6)));
  EXPECT_EQ(FrustumSeeds(ranking, 2, 100).size(), 8u);
  EXPECT_EQ(FrustumSeeds(ranking, 100, 2).size(), 8u);
}

TEST(SelectPairs, OverlapOfAnImageWithItselfIsFull) {
  EXPECT_DOUBLE_EQ(FrustumOverlap(At(0, 0), At(0, 0), {}), 1.0);
  EXPECT_DOUBLE_EQ(FrustumOverlap(At(0, 0), At(0, 180), {}), 0.0);
}

TEST(SelectPairs, OpposedViewsOfOneWallAreNotMatched) {
  // Facing each other 4 m apart: the same scene lies in both frusta, seen from opposite sides.
  PosedCamera opposite = At(0, 180);
  opposite.cam_from_world.translation = opposite.cam_from_world.rotation * Eigen::Vector3d(0, 0, -4);
  EXPECT_LT(FrustumOverlap(At(0, 0), opposite, {}), 0.05);
}

}  // namespace
}  // namespace cairn
