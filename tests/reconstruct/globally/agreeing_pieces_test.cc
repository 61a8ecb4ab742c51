#include "stages/reconstruct/globally/agreeing_pieces.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::reconstruct {
namespace {

using ::testing::ElementsAre;

TEST(AgreeingPieces, AreCutWhereMoreSpeaksAgainst) {
  // Two rings of three; one link holds them together, two others contradict it.
  const std::vector<SignedLink> links = {{0, 2, 90}, {2, 4, 80}, {4, 0, 70},  {1, 3, 60}, {3, 5, 50},
                                         {5, 1, 40}, {0, 1, 30}, {2, 3, -20}, {4, 5, -16}};
  EXPECT_THAT(AgreeingPieces(6, links, 0), ElementsAre(ElementsAre(0, 2, 4), ElementsAre(1, 3, 5)));
  std::vector<SignedLink> agreeing = links;
  agreeing.pop_back();
  EXPECT_THAT(AgreeingPieces(6, agreeing, 0), ElementsAre(ElementsAre(0, 1, 2, 3, 4, 5)));
}

TEST(AgreeingPieces, AreCutWhereLittleHoldsThemOnAverage) {
  // The mean of the four links between {0, 1} and {2, 3} is 10.
  const std::vector<SignedLink> links = {{0, 1, 100}, {2, 3, 100}, {1, 2, 40}};
  EXPECT_THAT(AgreeingPieces(4, links, 10), ElementsAre(ElementsAre(0, 1), ElementsAre(2, 3)));
  EXPECT_THAT(AgreeingPieces(4, links, 9.9), ElementsAre(ElementsAre(0, 1, 2, 3)));
}

TEST(AgreeingPieces, TheLargestComesFirstAndWhatNothingLinksIsAlone) {
  EXPECT_THAT(AgreeingPieces(5, {{1, 2, 5}, {2, 4, 5}, {0, 3, -1}}, 0),
              ElementsAre(ElementsAre(1, 2, 4), ElementsAre(0), ElementsAre(3)));
  EXPECT_TRUE(AgreeingPieces(0, {}, 0).empty());
}

// Several links between two images count together.
TEST(AgreeingPieces, LinksOfTwoImagesAreAdded) {
  EXPECT_THAT(AgreeingPieces(2, {{0, 1, 5}, {1, 0, -6}}, 0), ElementsAre(ElementsAre(0), ElementsAre(1)));
  EXPECT_THAT(AgreeingPieces(2, {{0, 1, 7}, {1, 0, -6}}, 0), ElementsAre(ElementsAre(0, 1)));
}

}  // namespace
}  // namespace cairn::reconstruct
