#include "stages/match_features/pairs/earlier_partners.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

// Partners in the order of their ranks.
std::vector<OverlapPartner> Ranked(const std::vector<int>& idxs) {
  std::vector<OverlapPartner> partners;
  for (const int idx : idxs) partners.push_back({idx, 1.0F / static_cast<float>(partners.size() + 1)});
  return partners;
}

using Ranking = std::vector<std::vector<OverlapPartner>>;  // of each image

IndexPairs Seeds(const Ranking& ranking, int num_best, int num_spread, EarlierPartners* partners) {
  std::vector<EarlierPartners::Seeds> seeds;
  for (int idx = 0; idx < static_cast<int>(ranking.size()); ++idx)
    seeds.push_back(partners->SeedsOf(idx, ranking[idx], num_best, num_spread));
  return partners->TakeSeeds(seeds);
}
IndexPairs Seeds(const Ranking& ranking, int num_best, int num_spread, EarlierPartners partners) {
  return Seeds(ranking, num_best, num_spread, &partners);
}

TEST(EarlierPartners, GenerationsBeginAgainWithTheThirdSession) {
  EXPECT_EQ(GenerationOfSession(0), 0);
  EXPECT_EQ(GenerationOfSession(1), 0);
  EXPECT_EQ(GenerationOfSession(2), 1);
  EXPECT_EQ(GenerationOfSession(5), 4);
}

TEST(EarlierPartners, OfTwoSessionsTheSeedsAreThoseOfOneSurvey) {
  //   session    0 0 1 1
  //   image      0 1 2 3
  const Ranking ranking = {Ranked({2, 1, 3}), Ranked({0, 2, 3}), Ranked({0, 1, 3}), Ranked({2, 0, 1})};
  for (const int num_best : {1, 2}) {
    for (const int num_spread : {0, 1}) {
      EXPECT_EQ(Seeds(ranking, num_best, num_spread, {{0, 0, 1, 1}, 0}),
                Seeds(ranking, num_best, num_spread, {{0, 0, 0, 0}, 0}));
    }
  }
  EXPECT_THAT(Seeds(ranking, 1, 0, {{0, 0, 1, 1}, 0}), ElementsAre(Pair(0, 1), Pair(0, 2), Pair(2, 3)));
}

TEST(EarlierPartners, SeedsAreOfTheOwnSessionAndOfTheEarlierInTurns) {
  //   session    0 0 1 1 2 2         of 4 the ranks are 0 1 2 | 5 | 3; of its own session 5, of
  //   image      0 1 2 3 4 5         the earlier in turns, the latest first, 2 0 3 1
  Ranking ranking(6);
  ranking[4] = Ranked({0, 1, 2, 5, 3});
  const auto seeds = [&](int num_best, int num_spread) {
    return Seeds(ranking, num_best, num_spread, {{0, 0, 1, 1, 2, 2}, 1});
  };
  EXPECT_THAT(seeds(1, 0), ElementsAre(Pair(2, 4), Pair(4, 5)));
  EXPECT_THAT(seeds(3, 0), ElementsAre(Pair(0, 4), Pair(2, 4), Pair(3, 4), Pair(4, 5)));
  EXPECT_THAT(seeds(2, 1), ElementsAre(Pair(0, 4), Pair(1, 4), Pair(2, 4), Pair(4, 5)));
}

TEST(EarlierPartners, NoSeedOfAnImageIsOfALaterSession) {
  //   session    0 1 2     each ranks both others; that of session 0 could have one seed, and it is not 2
  //   image      0 1 2
  const Ranking ranking = {Ranked({2, 1}), Ranked({2, 0}), {}};
  EXPECT_THAT(Seeds(ranking, 1, 0, {{0, 1, 2}, 1}), ElementsAre(Pair(0, 1)));
}

TEST(EarlierPartners, PairsWithinAGenerationAreNotBounded) {
  //   session    0 0 1 2 2
  //   image      0 1 2 3 4
  EarlierPartners partners({0, 0, 1, 2, 2}, 0);
  EXPECT_THAT(partners.Choose({{{0, 1}, 30}, {{0, 2}, 30}, {{1, 2}, 40}, {{2, 3}, 99}, {{3, 4}, 30}}),
              ElementsAre(Pair(0, 1), Pair(0, 2), Pair(1, 2), Pair(3, 4)));
}

TEST(EarlierPartners, AnImageHasAsManyAsTheSessionThatHasTheMostInTurns) {
  //   session    0 0 0 1 1 2        session 0 has three for image 5, so that three are chosen:
  //   image      0 1 2 3 4 5        the best of 1, the best of 0, the second of 1
  const std::vector<PredictedPair> predicted = {
      {{0, 5}, 60}, {{1, 5}, 80}, {{2, 5}, 70}, {{3, 5}, 30}, {{4, 5}, 40}};
  EXPECT_THAT(EarlierPartners({0, 0, 0, 1, 1, 2}, 1).Choose(predicted),
              ElementsAre(Pair(1, 5), Pair(3, 5), Pair(4, 5)));
  EXPECT_THAT(EarlierPartners({0, 0, 0, 1, 1, 2}, 0.3).Choose(predicted), ElementsAre(Pair(4, 5)));
  EXPECT_THAT(EarlierPartners({0, 0, 0, 1, 1, 2}, 1.1).Choose(predicted),
              ElementsAre(Pair(1, 5), Pair(2, 5), Pair(3, 5), Pair(4, 5)));
  EXPECT_THAT(EarlierPartners({0, 0, 0, 1, 1, 2}, 0).Choose(predicted), IsEmpty());
}

TEST(EarlierPartners, ASessionWithoutMoreLeavesItsTurnsToTheOthers) {
  //   session    0 0 0 0 1 2
  //   image      0 1 2 3 4 5
  EXPECT_THAT(EarlierPartners({0, 0, 0, 0, 1, 2}, 1)
                  .Choose({{{0, 5}, 40}, {{1, 5}, 30}, {{2, 5}, 50}, {{3, 5}, 20}, {{4, 5}, 10}}),
              ElementsAre(Pair(0, 5), Pair(1, 5), Pair(2, 5), Pair(4, 5)));
}

TEST(EarlierPartners, OfEqualPairsTheSmallerIndexIsChosen) {
  EXPECT_THAT(EarlierPartners({0, 0, 0, 2}, 0.5).Choose({{{0, 3}, 40}, {{1, 3}, 40}, {{2, 3}, 40}}),
              ElementsAre(Pair(0, 3), Pair(1, 3)));
}

TEST(EarlierPartners, WhatWasChosenAndWhatWasNotCountsLater) {
  //   session    0 0 0 0 1 1 1 2
  //   image      0 1 2 3 4 5 6 7
  Ranking ranking(8);
  ranking[7] = Ranked({4, 0});
  EarlierPartners partners({0, 0, 0, 0, 1, 1, 1, 2}, 1);
  // Two seeds, one in each session.
  EXPECT_THAT(Seeds(ranking, 2, 0, &partners), ElementsAre(Pair(0, 7), Pair(4, 7)));
  // Now session 1 has two, as many as are chosen.
  EXPECT_THAT(partners.Choose({{{5, 7}, 90}}), IsEmpty());
  // Session 1 has three with the one that was not chosen; of one more, session 0 has fewer when 1 was served.
  EXPECT_THAT(partners.Choose({{{1, 7}, 30}, {{6, 7}, 90}}), ElementsAre(Pair(6, 7)));
  EXPECT_THAT(partners.Choose({{{2, 7}, 30}, {{3, 7}, 20}}), ElementsAre(Pair(2, 7)));
}

TEST(EarlierPartners, SessionsCountAndNotTheOrderOfImages) {
  //   session    2 1 0 0        image 0 is of the last session
  //   image      0 1 2 3
  EarlierPartners partners({2, 1, 0, 0}, 1);
  Ranking ranking(4);
  ranking[0] = Ranked({3, 1});
  ranking[1] = Ranked({0});
  EXPECT_THAT(Seeds(ranking, 1, 0, &partners), ElementsAre(Pair(0, 1)));
  EXPECT_THAT(partners.Choose({{{0, 2}, 30}, {{0, 3}, 40}, {{1, 2}, 30}}),
              ElementsAre(Pair(0, 3), Pair(1, 2)));
}

}  // namespace
}  // namespace cairn::match_features
