#include "stages/match_features/two_views/match_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::Pair;

TEST(MatchPairs, OrderFollowsTheCurve) {
  //        idx2  1  2  3      the curve visits (0, 1), then the square of 0 1 x 2 3 in the order
  // idx1 0       1  2  3      0 2, 0 3, 1 2, 1 3, then 2 3
  //      1          4  5
  //      2             6
  IndexPairs pairs = {{2, 3}, {1, 3}, {0, 3}, {1, 2}, {0, 2}, {0, 1}};
  SortAlongCurve(&pairs);
  EXPECT_THAT(pairs, ElementsAre(Pair(0, 1), Pair(0, 2), Pair(0, 3), Pair(1, 2), Pair(1, 3), Pair(2, 3)));
}

TEST(MatchPairs, StretchesFitTheBudget) {
  const int64_t size = 1000;
  const std::vector<int64_t> images(4, size);
  IndexPairs pairs = ExhaustivePairs(4);
  SortAlongCurve(&pairs);
  EXPECT_THAT(CutIntoStretches(pairs, images, 4 * size), ElementsAre(6));
  // 01 02 | 03 | 12 13 23: each bar stands where a fourth image would be held.
  EXPECT_THAT(CutIntoStretches(pairs, images, 3 * size), ElementsAre(2, 3, 6));
  // Two images are held, whatever the budget.
  EXPECT_THAT(CutIntoStretches(pairs, images, 1), ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_TRUE(CutIntoStretches({}, images, 1).empty());
}

TEST(MatchPairs, FewImagesAreReadAgainForASmallBudget) {
  // 256 images exhaustively, 32 held at a time: the pairs are 8 x 8 / 2 blocks of 32 x 32 images, each read
  // as a part of 2 x 16 images; image by image it would be 256 * 255 / 2 reads.
  const std::vector<int64_t> images(256, 1000);
  IndexPairs pairs = ExhaustivePairs(256);
  SortAlongCurve(&pairs);
  const std::vector<int64_t> ends = CutIntoStretches(pairs, images, 32 * 1000);
  EXPECT_LE(ends.size() * 32, 256 * 255 / 2 / 6);
  EXPECT_TRUE(std::is_sorted(ends.begin(), ends.end()));
  EXPECT_EQ(ends.back(), 256 * 255 / 2);
}

}  // namespace
}  // namespace cairn::match_features
