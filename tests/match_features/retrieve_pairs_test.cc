#include "stages/match_features/pairs/retrieve_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

const auto kAll = [](int) { return true; };

TEST(RetrievePairs, SharedRareWordsCountMost) {
  // Word 0 is in all images and says nothing.  Word 1 is in 0 and 1 only; word 2 in 0, 2 and 3.
  const ImageSimilarity similarity({{0, 1, 2}, {0, 1}, {0, 2}, {0, 2}, {0}}, 3);
  // idf: ln(5 / 2) = 0.92, ln(5 / 3) = 0.51; 0 . 1 = 0.92 / 1.05 = 0.87, 0 . 2 = 0.51 / 1.05 = 0.49.
  EXPECT_THAT(similarity.MostSimilar(0, 9, kAll), ElementsAre(1, 2, 3));
  EXPECT_THAT(similarity.MostSimilar(0, 2, kAll), ElementsAre(1, 2));
  EXPECT_THAT(similarity.MostSimilar(1, 9, kAll), ElementsAre(0));
  EXPECT_THAT(similarity.MostSimilar(2, 9, kAll), ElementsAre(3, 0));
  EXPECT_THAT(similarity.MostSimilar(4, 9, kAll), IsEmpty());
}

TEST(RetrievePairs, APairStandsOnceWhoeverAsked) {
  const ImageSimilarity similarity({{0, 0, 1}, {0, 0}, {1}, {2}}, 3);
  EXPECT_THAT(PairsFromPartners(RetrievedPartners(similarity, {0, 1, 2, 3}, 1, 2)),
              ElementsAre(Pair(0, 1), Pair(0, 2)));
  EXPECT_THAT(PairsFromPartners(RetrievedPartners(similarity, {0, 1, 2, 3}, 3, 1)),
              ElementsAre(Pair(0, 1), Pair(0, 2)));
}

TEST(RetrievePairs, SomeImagesArePairedAsAllAre) {
  const ImageSimilarity similarity({{0, 0, 1}, {0, 0}, {1}, {2}}, 3);
  const auto all = RetrievedPartners(similarity, {0, 1, 2, 3}, 2, 2);
  EXPECT_THAT(RetrievedPartners(similarity, {2, 0}, 2, 2), ElementsAre(all[2], all[0]));
}

TEST(RetrievePairs, LoopCandidatesAreNoNeighbours) {
  // A round: image 5 is back where 0 was; all neighbours share a word too.
  const ImageSimilarity similarity({{0, 9}, {0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 9}, {5}}, 10);
  const std::vector<int> all = {0, 1, 2, 3, 4, 5, 6};
  EXPECT_THAT(PairsFromPartners(LoopPartners(similarity, all, all, 2, 1, 2)), ElementsAre(Pair(0, 5)));
  EXPECT_THAT(PairsFromPartners(LoopPartners(similarity, all, all, 5, 1, 2)), IsEmpty());
}

}  // namespace
}  // namespace cairn::match_features
