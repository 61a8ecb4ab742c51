#include "stages/match_features/pairs/neighbourhood.h"

#include <algorithm>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::match_features {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr int64_t kMuch = 1 << 20;

// Images of which the i-th has i + 1 features.
MatchedRays Images(int num) {
  MatchedRays matched(testing::TempDir() + "/matched", 0);
  for (int i = 0; i < num; ++i)
    matched.AddView(std::vector<Eigen::Vector3f>(i + 1, Eigen::Vector3f(static_cast<float>(i), 0, 1)));
  return matched;
}

//  0 - 1 - 2 - 3 - 4 - 5, feature 0 of each with feature 0 of the next
MatchedRays Chain() {
  MatchedRays matched = Images(6);
  for (int i = 0; i < 5; ++i) matched.AddPair(i, i + 1, std::vector<Match>{{0, 0}});
  return matched;
}

std::vector<int> ViewsOf(const Neighbourhood& near) {
  std::vector<int> views;
  for (int slot = 0; slot < near.num_slots(); ++slot) {
    if (near.ViewOf(slot) >= 0) views.push_back(near.ViewOf(slot));
  }
  std::sort(views.begin(), views.end());
  return views;
}

// Of a feature's links: image, feature, whether it is new.
std::vector<std::tuple<int, int, bool>> LinksOf(const Neighbourhood& near, int view, uint32_t feature) {
  std::vector<std::tuple<int, int, bool>> links;
  for (const Neighbourhood::Link& link : near.At(near.SlotOf(view)).LinksOf(feature))
    links.emplace_back(near.ViewOf(link.slot), static_cast<int>(link.feature), link.is_new != 0);
  return links;
}

TEST(MatchedRays, SaysHowManyFeaturesAndMatchesThereAre) {
  MatchedRays matched = Images(3);
  matched.AddPair(0, 2, std::vector<Match>{{0, 1}, {0, 2}});
  matched.AddPair(1, 2, std::vector<Match>{{1, 0}});
  EXPECT_EQ(matched.num_views(), 3);
  EXPECT_EQ(matched.NumFeatures(2), 3u);
  EXPECT_EQ(matched.NumMatches(0), 2u);
  EXPECT_EQ(matched.NumMatches(1), 1u);
  EXPECT_THAT(*matched.ReadMatches(0), ElementsAre(Match{0, 1}, Match{0, 2}));
  EXPECT_THAT(*matched.ReadMatches(1), ElementsAre(Match{1, 0}));
  EXPECT_THAT(*matched.ReadRays(1), ElementsAre(Eigen::Vector3f(1, 0, 1), Eigen::Vector3f(1, 0, 1)));
}

TEST(Neighbourhood, HasTheImagesThatTwoMatchesLeadTo) {
  const MatchedRays matched = Chain();
  Neighbourhood near(matched, 0, 1);
  ASSERT_EQ(*near.MoveTo({0, 3}, 0, 2), 1u);
  EXPECT_THAT(ViewsOf(near), ElementsAre(0, 1, 2));
  ASSERT_EQ(*near.MoveTo({0, 3}, 1, 2), 2u);
  EXPECT_THAT(ViewsOf(near), ElementsAre(1, 2, 3, 4, 5));
  for (const int view : {1, 5}) {  // at the end: rays only
    EXPECT_THAT(near.At(near.SlotOf(view)).first_link, IsEmpty());
    EXPECT_EQ(near.At(near.SlotOf(view)).rays.size(), static_cast<size_t>(view) + 1);
  }
  EXPECT_THAT(LinksOf(near, 3, 0), ElementsAre(std::tuple(2, 0, true), std::tuple(4, 0, true)));
  EXPECT_THAT(LinksOf(near, 3, 1), IsEmpty());
}

TEST(Neighbourhood, TakesAsManyImagesAsMemoryAllows) {
  const MatchedRays matched = Chain();
  const std::vector<int> all = {0, 1, 2, 3, 4, 5};
  EXPECT_EQ(*Neighbourhood(matched, 0, kMuch).MoveTo(all, 0, 1), 6u);
  EXPECT_EQ(*Neighbourhood(matched, 0, kMuch).MoveTo(all, 4, 1), 6u);
  EXPECT_EQ(*Neighbourhood(matched, 0, 0).MoveTo(all, 2, 1), 3u);
  //  Image 0 needs the rays of 0, 1 and 2, 6 of 12 bytes; links of 0 and 1, 3 of 8; 5 and 5 places of
  //  features.
  constexpr int64_t kBytes = 6 * 12 + 3 * 8 + (2 + 3) * 5;
  EXPECT_EQ(*Neighbourhood(matched, 0, kBytes).MoveTo(all, 0, 1), 1u);
  EXPECT_EQ(*Neighbourhood(matched, 0, kBytes + 1).MoveTo(all, 0, 1), 2u);
}

TEST(Neighbourhood, LinksLeadToTheSameImagesAfterEveryMove) {
  const MatchedRays matched = Chain();
  Neighbourhood near(matched, 0, 1);
  for (const int image : {0, 1, 2, 5, 4, 3, 0, 5, 1}) {
    ASSERT_TRUE(near.MoveTo({image}, 0, 2).ok());
    std::vector<std::tuple<int, int, bool>> expected;
    for (const int other : {image - 1, image + 1}) {
      if (other >= 0 && other < 6) expected.emplace_back(other, 0, true);
    }
    EXPECT_EQ(LinksOf(near, image, 0), expected) << image;
    for (const auto& [other, feature, is_new] : expected)
      EXPECT_EQ(near.At(near.SlotOf(other)).LinksOf(0).size(), other == 0 || other == 5 ? 1u : 2u) << image;
  }
}

TEST(Neighbourhood, LinksAreByAscendingImagesWhateverTheOrderOfThePairs) {
  MatchedRays matched = Images(4);
  matched.AddPair(1, 3, std::vector<Match>{{1, 2}});
  matched.AddPair(0, 1, std::vector<Match>{{0, 1}});
  matched.AddPair(1, 2, std::vector<Match>{{1, 0}, {1, 1}});
  Neighbourhood near(matched, 0, kMuch);
  ASSERT_TRUE(near.MoveTo({1}, 0, 1).ok());
  EXPECT_THAT(LinksOf(near, 1, 1), ElementsAre(std::tuple(0, 0, true), std::tuple(2, 0, true),
                                               std::tuple(2, 1, true), std::tuple(3, 2, true)));
}

TEST(Neighbourhood, KnowsWhatIsNew) {
  //  0 - 1 = 2 - 3 - 4    only 1 = 2 is new
  MatchedRays matched = Images(5);
  matched.AddPair(0, 1, std::vector<Match>{{0, 0}});
  matched.AddPair(2, 3, std::vector<Match>{{0, 0}});
  matched.AddPair(3, 4, std::vector<Match>{{0, 0}});
  matched.AddPair(1, 2, std::vector<Match>{{1, 2}});
  Neighbourhood near(matched, 3, kMuch);
  EXPECT_TRUE(near.HasNewChain(0));
  EXPECT_TRUE(near.HasNewChain(1));
  EXPECT_TRUE(near.HasNewChain(3));
  EXPECT_FALSE(near.HasNewChain(4));
  ASSERT_TRUE(near.MoveTo({1}, 0, 1).ok());
  EXPECT_THAT(LinksOf(near, 1, 0), ElementsAre(std::tuple(0, 0, false)));
  EXPECT_THAT(LinksOf(near, 1, 1), ElementsAre(std::tuple(2, 2, true)));
  EXPECT_THAT(near.At(near.SlotOf(2)).has_new_link, ElementsAre(0, 0, 1));
}

TEST(Neighbourhood, ImagesWithoutMatchesAreAlone) {
  const MatchedRays matched = Images(3);
  Neighbourhood near(matched, 0, kMuch);
  EXPECT_FALSE(near.HasNewChain(1));
  ASSERT_EQ(*near.MoveTo({1}, 0, 1), 1u);
  EXPECT_THAT(ViewsOf(near), ElementsAre(1));
  EXPECT_THAT(LinksOf(near, 1, 0), IsEmpty());
}

}  // namespace
}  // namespace cairn::match_features
