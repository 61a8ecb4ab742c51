#include "stages/match_features/pairs/select_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/text.h"

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

TEST(SelectPairs, ExhaustiveAndSequencePairsAreAscending) {
  EXPECT_THAT(ExhaustivePairs(3), ElementsAre(Pair(0, 1), Pair(0, 2), Pair(1, 2)));
  EXPECT_THAT(SequencePairs({0, 1, 2, 3}, 1), ElementsAre(Pair(0, 1), Pair(1, 2), Pair(2, 3)));
  EXPECT_TRUE(ExhaustivePairs(1).empty());
  EXPECT_TRUE(ExhaustivePairs(0).empty());
}

TEST(SelectPairs, SequenceFollowsNumbersInNames) {
  EXPECT_THAT(SequencePairs(NaturalOrder({"1.jpg", "10.jpg", "2.jpg"}), 1),
              ElementsAre(Pair(0, 2), Pair(1, 2)));
}

TEST(SelectPairs, ScoutsStandAtEvenDistancesInTheOtherRanks) {
  //  partners of image 0 by rank    1 2 | 3 4 5 6 7 8
  //  two seeds, two scouts          # # |   #     #       the middles of both halves of the rest
  //  two seeds, one scout           # # |       #
  const std::vector<int> ranked = {1, 2, 3, 4, 5, 6, 7, 8};
  EXPECT_THAT(SeedsAmong(ranked, 2, 2), ElementsAre(1, 2, 4, 7));
  EXPECT_THAT(SeedsAmong(ranked, 2, 1), ElementsAre(1, 2, 6));
  EXPECT_EQ(SeedsAmong(ranked, 2, 100), ranked);
  EXPECT_EQ(SeedsAmong(ranked, 100, 2), ranked);
  EXPECT_THAT(SeedsAmong(ranked, 0, 0), IsEmpty());
  EXPECT_THAT(SeedsAmong({}, 2, 2), IsEmpty());
}

TEST(SelectPairs, APairOfTwoPartnersIsOnePair) {
  EXPECT_THAT(PairsFromPartners({{2, 1}, {0}, {}}), ElementsAre(Pair(0, 1), Pair(0, 2)));
}

}  // namespace
}  // namespace cairn::match_features
