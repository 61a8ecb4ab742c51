// How much of an image each map of an atlas knows: against all codes one by one, and scores by hand.
#include "runtime/atlas/code_index.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

using testing::ElementsAre;

// Descriptors far from each other, and the atlas of maps that have them: places[map][place] lists their
// indices.
class CodeIndexTest : public testing::Test {
 protected:
  CodeIndexTest() : descriptors_(600, kSiftDescriptorDim) {
    Random random(1);
    for (int i = 0; i < 600; ++i) descriptors_.row(i) = RandomDescriptor(random);
    atlas_.code_book = LearnCodeBook(descriptors_);
  }
  DescriptorCode Code(int i) const { return CodeOf(atlas_.code_book, descriptors_.row(i).data()); }
  void SetPlaces(const std::vector<std::vector<std::vector<int>>>& places) {
    atlas_.maps.clear();
    for (const auto& of_map : places) {
      AtlasMap map;
      for (const std::vector<int>& place : of_map) {
        map.places.emplace_back();
        for (const int i : place) map.places.back().push_back(Code(i).bits);
      }
      atlas_.maps.push_back(std::move(map));
    }
  }
  // An image that shows these, the first with the largest features.
  Features Showing(const std::vector<int>& shown) const {
    Features features;
    features.descriptors.resize(static_cast<Eigen::Index>(shown.size()), kSiftDescriptorDim);
    for (size_t i = 0; i < shown.size(); ++i) {
      features.keypoints.push_back({0, 0, 1 + 1 / static_cast<float>(1 + i), 0});
      features.descriptors.row(static_cast<Eigen::Index>(i)) = descriptors_.row(shown[i]);
    }
    return features;
  }
  // As many of the descriptors as are wanted of which no two may be taken for each other.
  std::vector<int> Distinct(size_t num) const {
    std::vector<int> found;
    for (int i = 0; i < 600 && found.size() < num; ++i) {
      const bool is_distinct = std::all_of(found.begin(), found.end(), [&](int other) {
        return CostOf(Code(i), Code(other).bits) > 25 && CostOf(Code(other), Code(i).bits) > 25;
      });
      if (is_distinct) found.push_back(i);
    }
    EXPECT_EQ(found.size(), num);
    return found;
  }

  DescriptorMatrix descriptors_;
  AtlasRows atlas_;
};

// A bit that is another counts by how far the descriptor is from it: up to 25 in all.
TEST_F(CodeIndexTest, KnowsTheFeaturesOfWhichACodeIsNearEnough) {
  std::vector<std::vector<std::vector<int>>> places(3);
  for (int map = 0; map < 3; ++map) {
    places[map].resize(4);
    for (int i = 0; i < 100; ++i) places[map][i % 4].push_back(3 * i + map);
  }
  SetPlaces(places);
  const CodeIndex index(atlas_);
  int num_known = 0, num_not = 0;
  for (int i = 0; i < 600; ++i) {
    const std::vector<MapScore> ranked = index.Rank(Showing({i}));
    ASSERT_EQ(ranked.size(), 3U);
    const std::vector<int32_t> with = index.MapsWith(Code(i));
    EXPECT_TRUE(std::is_sorted(with.begin(), with.end()));
    for (const MapScore& score : ranked) {
      const auto& of_map = atlas_.maps[score.map].places;
      const bool is_known = std::any_of(of_map.begin(), of_map.end(), [&](const auto& place) {
        return std::any_of(place.begin(), place.end(),
                           [&](uint32_t code) { return CostOf(Code(i), code) <= 25; });
      });
      EXPECT_EQ(!score.features.empty(), is_known) << i;
      EXPECT_EQ(std::count(with.begin(), with.end(), score.map), is_known ? 1 : 0) << i;
      (is_known ? num_known : num_not) += 1;
    }
  }
  EXPECT_GE(num_known, 300);
  EXPECT_GT(num_not, 300);
}

TEST_F(CodeIndexTest, ACodeIsNearUpToTheMostThatBitsMayCost) {
  for (const int cost : {25, 26}) {
    int num_tried = 0;
    for (int i = 0; i < 100; ++i) {
      for (int bit = 1; bit < kNumCodeBits; ++bit) {
        const uint32_t other = Code(i).bits ^ 1U ^ (1U << bit);
        if (CostOf(Code(i), other) != cost) continue;
        AtlasMap map;
        map.places = {{other}};
        atlas_.maps = {map};
        EXPECT_EQ(CodeIndex(atlas_).MapsWith(Code(i)).size(), cost == 25 ? 1U : 0U);
        ++num_tried;
      }
      if (num_tried > 5) break;
    }
    EXPECT_GT(num_tried, 5);
  }
}

// Of 6 places, 3 of each map; the image shows 4 landmarks of one, 1 of the next and 1 of the other map.
//   expected by chance in two places: 2 * 6 / 6
TEST_F(CodeIndexTest, EvidenceIsHowImprobableSoManyAreInTwoPlaces) {
  const std::vector<int> all = Distinct(30);
  const auto at = [&](int begin) { return std::vector<int>(all.begin() + begin, all.begin() + begin + 5); };
  SetPlaces({{at(0), at(5), at(10)}, {at(15), at(20), at(25)}});
  const CodeIndex index(atlas_);
  const std::vector<MapScore> ranked =
      index.Rank(Showing({all[16], all[17], all[18], all[19], all[20], all[3]}));
  ASSERT_EQ(ranked.size(), 2U);
  const double by_chance = 2 * 6 / 6.0;
  EXPECT_EQ(ranked[0].map, 1);
  EXPECT_NEAR(ranked[0].score, 5 * std::log(5 / by_chance) - 5 + by_chance - std::log(3), 1e-9);
  EXPECT_THAT(ranked[0].features, ElementsAre(0, 1, 2, 3, 4));
  // Fewer than by chance speak against a map.
  EXPECT_EQ(ranked[1].map, 0);
  EXPECT_NEAR(ranked[1].score, -(1 * std::log(1 / by_chance) - 1 + by_chance) - std::log(3), 1e-9);
  EXPECT_THAT(ranked[1].features, ElementsAre(5));
}

TEST_F(CodeIndexTest, APlaceIsSeenWithTheNextOfItsMapAlone) {
  const std::vector<int> all = Distinct(30);
  const auto at = [&](int begin) { return std::vector<int>(all.begin() + begin, all.begin() + begin + 5); };
  SetPlaces({{at(0), at(5), at(10)}, {at(15), at(20), at(25)}});
  const CodeIndex index(atlas_);
  // The last place of the first map and the first of the second.
  const std::vector<MapScore> ranked = index.Rank(Showing({all[10], all[11], all[12], all[15]}));
  EXPECT_EQ(ranked[0].map, 0);
  EXPECT_THAT(ranked[0].features, ElementsAre(0, 1, 2));
  EXPECT_THAT(ranked[1].features, ElementsAre(3));
  const double by_chance = 2 * 4 / 6.0;
  EXPECT_NEAR(ranked[0].score, 3 * std::log(3 / by_chance) - 3 + by_chance - std::log(3), 1e-9);
}

// What both maps have counts half for each, what one has counts whole; and none of a map without landmarks in
// view.
TEST_F(CodeIndexTest, AFeatureThatSeveralMapsHaveCountsByAsManyParts) {
  const std::vector<int> all = Distinct(20);
  SetPlaces({{{all[0], all[1], all[2]}}, {{all[0], all[3]}, {all[4]}}, {{all[5]}, {all[6]}, {all[7]}}});
  const std::vector<MapScore> ranked = CodeIndex(atlas_).Rank(Showing({all[0], all[1], all[2]}));
  ASSERT_EQ(ranked.size(), 3U);
  const double by_chance = 2 * (0.5 + 2 + 0.5) / 6;  // of six places
  EXPECT_EQ(ranked[0].map, 0);
  EXPECT_NEAR(ranked[0].score, 2.5 * std::log(2.5 / by_chance) - 2.5 + by_chance, 1e-9);
  EXPECT_EQ(ranked[1].map, 1);
  EXPECT_NEAR(ranked[1].score, -(0.5 * std::log(0.5 / by_chance) - 0.5 + by_chance) - std::log(2), 1e-9);
  EXPECT_EQ(ranked[2].map, 2);
  EXPECT_NEAR(ranked[2].score, -by_chance - std::log(3), 1e-9);
  EXPECT_THAT(ranked[2].features, ElementsAre());
}

TEST_F(CodeIndexTest, WhereNothingIsKnownAllAreAlikeButForTheirSizes) {
  const std::vector<int> all = Distinct(10);
  SetPlaces({{{all[0]}, {all[1]}, {all[2]}}, {{all[3]}}, {{all[4]}, {all[5]}}});
  const CodeIndex index(atlas_);
  const std::vector<MapScore> ranked = index.Rank(Showing({all[8]}));
  ASSERT_EQ(ranked.size(), 3U);
  EXPECT_EQ(ranked[0].map, 1);
  EXPECT_EQ(ranked[2].map, 0);
  EXPECT_NEAR(ranked[0].score, -0.05, 1e-12);  // no less is expected than a twentieth
  EXPECT_TRUE(index.Rank({}).empty());
}

// A thousand at most, the largest: the one of map 1 is the smallest.
TEST_F(CodeIndexTest, TheLargestFeaturesCount) {
  const std::vector<int> all = Distinct(3);
  SetPlaces({{{all[0]}}, {{all[1]}}});
  const CodeIndex index(atlas_);
  for (const int num_others : {999, 1000}) {
    std::vector<int> shown(num_others, all[2]);
    shown.push_back(all[1]);
    Features features = Showing(shown);
    std::reverse(features.keypoints.begin(), features.keypoints.end() - 1);
    features.keypoints.back().scale = 0.5;
    bool is_known = false;
    for (const MapScore& score : index.Rank(features)) is_known = is_known || !score.features.empty();
    EXPECT_EQ(is_known, num_others == 999);
  }
}

}  // namespace
}  // namespace cairn
