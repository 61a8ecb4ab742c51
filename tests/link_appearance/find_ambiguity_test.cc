#include "stages/link_appearance/find_ambiguity.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/link_appearance/graphs.h"

namespace cairn::link_appearance {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

// Images 1, 2, ... with these words, one of each.
Vocabulary VocabularyOf(const std::vector<std::vector<WordIdx>>& words_of_image, int num_words) {
  Vocabulary vocabulary;
  vocabulary.inverted_files.resize(num_words);
  for (size_t i = 0; i < words_of_image.size(); ++i) {
    vocabulary.document_ids.push_back(static_cast<ImageId>(i + 1));
    for (const WordIdx word : words_of_image[i])
      vocabulary.inverted_files[word].push_back({static_cast<int32_t>(i), 1});
  }
  WeightVocabulary(&vocabulary);
  return vocabulary;
}

Appearance NodesWithAnImageEach(int num_nodes, const std::vector<std::pair<NodeIdx, NodeIdx>>& links) {
  Appearance appearance;
  for (int i = 0; i < num_nodes; ++i) appearance.nodes.push_back({.images = {static_cast<ImageId>(i + 1)}});
  appearance.graph = GraphOf(num_nodes, links);
  appearance.lower_bounds = {0};
  return appearance;
}

std::vector<std::optional<FloorPose>> PlacesAt(const std::vector<double>& xs) {
  std::vector<std::optional<FloorPose>> places;
  for (const double x : xs) places.push_back(FloorPose{{x, 0}, 0});
  return places;
}

// Images 0 and 2 are twins; 1 is like no other; 3 shares a word with 1.
const std::vector<std::vector<WordIdx>> kTwins = {{0, 1, 2}, {3, 4, 5, 6}, {0, 1, 2}, {6, 7, 8, 9}};

// Twins a metre apart, nearer than places that differ have to be: what their matches say decides.
TEST(FindAmbiguity, LookAlikesAreConfusableWhereverTheyLie) {
  const std::vector<std::vector<WordIdx>> words = {{0, 1, 2}, {3, 4, 5, 6}, {0, 1, 2, 7}, {7, 8, 9}};
  Appearance near = NodesWithAnImageEach(4, {{0, 1}, {2, 3}});
  Appearance told = near;
  const auto places = PlacesAt({0, 0, 1, 1});
  ASSERT_TRUE(FindAmbiguity(VocabularyOf(words, 10), places, {}, 1, nullptr, &near).ok());
  EXPECT_THAT(near.confusable, IsEmpty());
  EXPECT_LT(*near.nodes[0].entropy, 0.1);
  const AppearanceGraph look_alikes = GraphOf(4, {{0, 2}, {1, 3}});
  ASSERT_TRUE(FindAmbiguity(VocabularyOf(words, 10), places, {}, 1, nullptr, &told, &look_alikes).ok());
  ASSERT_FALSE(told.confusable.empty());
  EXPECT_EQ(told.confusable[0].node1, 0);
  EXPECT_EQ(told.confusable[0].node2, 2);
  EXPECT_GT(*told.nodes[0].entropy, 0.5);
}

TEST(FindAmbiguity, TwinsHaveTheEntropyOfTwoPlacesAndAreConfusable) {
  Appearance appearance = NodesWithAnImageEach(4, {{0, 1}, {1, 2}, {2, 3}});
  ASSERT_TRUE(
      FindAmbiguity(VocabularyOf(kTwins, 10), PlacesAt({0, 5, 10, 15}), {}, 1, nullptr, &appearance).ok());
  EXPECT_EQ(appearance.nodes[0].entropy, 0.693);  // ln 2
  EXPECT_EQ(appearance.nodes[2].entropy, 0.693);
  EXPECT_LT(*appearance.nodes[1].entropy, 0.01);
  EXPECT_EQ(appearance.confusable[0], (ConfusablePair{0, 2, 1}));
}

// Images 0 to 5 look the same, so that the entropy says into how many nodes places fall.
TEST(FindAmbiguity, PlacesAreWhatIsLinkedOrNear) {
  const auto entropy_of = [](const std::vector<double>& sizes) {
    double entropy = 0;
    for (const double size : sizes) entropy -= size / 6 * std::log(size / 6);
    return entropy;
  };
  const Vocabulary vocabulary =
      VocabularyOf({{0, 1}, {0, 1}, {0, 1}, {0, 1}, {0, 1}, {0, 1}, {2}, {2}, {3}}, 4);
  // 1 is near 0 and linked to it, 2 is near 1, 3 has no place and is linked to 2, 4 has no place, 5 is 3 m
  // from 0.
  Appearance appearance = NodesWithAnImageEach(9, {{0, 1}, {2, 3}});
  auto places = PlacesAt({-1, -1, -1, 0, 0, 2, 90, 90, 90});
  const double ys[] = {-1, 1.5, 2.5, 0, 0, -1};
  for (int node = 0; node < 6; ++node) places[node]->position.y() = ys[node];
  places[3].reset();
  places[4].reset();
  Appearance told = appearance;
  ASSERT_TRUE(FindAmbiguity(vocabulary, places, {}, 1, nullptr, &appearance).ok());
  EXPECT_NEAR(*appearance.nodes[0].entropy, entropy_of({2, 2, 1, 1}), 1e-3);
  EXPECT_NEAR(*appearance.nodes[1].entropy, entropy_of({3, 1, 1, 1}), 1e-3);
  EXPECT_NEAR(*appearance.nodes[3].entropy, entropy_of({2, 2, 1, 1}), 1e-3);
  EXPECT_NEAR(*appearance.nodes[4].entropy, entropy_of({1, 2, 2, 1}), 1e-3);
  const AppearanceGraph look_alikes = GraphOf(9, {{1, 2}});
  ASSERT_TRUE(FindAmbiguity(vocabulary, places, {}, 1, nullptr, &told, &look_alikes).ok());
  EXPECT_NEAR(*told.nodes[1].entropy, entropy_of({2, 2, 1, 1}), 1e-3);
}

TEST(FindAmbiguity, ImagesOfOnePlaceAreNoLookAlikes) {
  // 0, 1, 2 stand side by side, 3 is linked to 0, and 4, 5 side by side far away: all show the same.
  const std::vector<std::vector<WordIdx>> words = {{0, 1}, {0, 1}, {0, 1}, {0, 1}, {0, 1}, {0, 1}, {2}};
  const auto places = PlacesAt({0, 1, 2, 8, 20, 21, 40});
  const auto entropies = [&](const AmbiguityOptions& options) {
    Appearance appearance = NodesWithAnImageEach(7, {{0, 3}});
    EXPECT_TRUE(FindAmbiguity(VocabularyOf(words, 3), places, options, 1, nullptr, &appearance).ok());
    std::vector<double> values;
    for (const AppearanceNode& node : appearance.nodes) values.push_back(*node.entropy);
    return values;
  };
  const auto of_two = [](double p) { return -p * std::log(p) - (1 - p) * std::log(1 - p); };
  const std::vector<double> over_places = entropies({});
  EXPECT_NEAR(over_places[0], of_two(4 / 6.0), 1e-3);
  EXPECT_NEAR(over_places[1], -std::log(.5) / 2 - std::log(1 / 3.) / 3 - std::log(1 / 6.) / 6,
              1e-3);  // 3 apart
  EXPECT_NEAR(over_places[4], of_two(2 / 6.0), 1e-3);
  EXPECT_EQ(over_places[6], 0);
  const std::vector<double> over_images = entropies({.entropy_over = "images"});
  EXPECT_NEAR(over_images[0], std::log(6.0), 1e-3);
  EXPECT_EQ(over_images[6], 0);
}

TEST(FindAmbiguity, WhatIsNearLinkedOrWithoutPlaceIsNotConfusable) {
  const auto pairs = [](const std::vector<std::optional<FloorPose>>& places, bool linked) {
    Appearance appearance = NodesWithAnImageEach(4, {{0, 1}, {linked ? 0 : 1, 2}, {1, 3}});
    EXPECT_TRUE(FindAmbiguity(VocabularyOf(kTwins, 10), places, {}, 1, nullptr, &appearance).ok());
    return appearance.confusable;
  };
  EXPECT_THAT(pairs(PlacesAt({0, 5, 2.9, 5.1}), false), IsEmpty());
  EXPECT_THAT(pairs(PlacesAt({0, 5, 3, 5.1}), false), ElementsAre(ConfusablePair{0, 2, 1}));
  EXPECT_THAT(pairs(PlacesAt({0, 5, 3, 5.1}), true), IsEmpty());
  EXPECT_THAT(pairs({}, false), IsEmpty());
  EXPECT_THAT(pairs({std::nullopt, std::nullopt, std::nullopt, std::nullopt}, false), IsEmpty());
}

TEST(FindAmbiguity, AnImageWithoutWordsCouldBeAnywhere) {
  std::vector<std::vector<WordIdx>> words = kTwins;
  words[1].clear();
  Appearance appearance = NodesWithAnImageEach(5, {});  // image 5 is no document
  ASSERT_TRUE(
      FindAmbiguity(VocabularyOf(words, 10), PlacesAt({0, 5, 10, 15, 20}), {}, 1, nullptr, &appearance).ok());
  EXPECT_NEAR(*appearance.nodes[4].entropy, std::log(5.0), 1e-3);
  EXPECT_NEAR(*appearance.nodes[1].entropy, std::log(4.0), 1e-3);  // of the documents
}

TEST(FindAmbiguity, FusedImagesAreOnePlace) {
  Appearance appearance;
  appearance.nodes = {{.images = {1, 3}}, {.images = {2}}, {.images = {4}}};  // the twins stand at one place
  appearance.graph = GraphOf(3, {{0, 1}, {1, 2}});
  ASSERT_TRUE(
      FindAmbiguity(VocabularyOf(kTwins, 10), PlacesAt({0, 5, 10}), {}, 1, nullptr, &appearance).ok());
  EXPECT_EQ(appearance.nodes[0].entropy, 0);
  EXPECT_THAT(appearance.confusable, IsEmpty());
}

TEST(FindAmbiguity, IsTheSameForAnyNumberOfThreadsAndSurvivesTheFile) {
  std::vector<std::vector<WordIdx>> words;
  Random random(3);
  for (int i = 0; i < 60; ++i) {
    for (WordIdx word = 0; word < 100; ++word) {
      if (random.Uniform() < 0.2) words.resize(i + 1), words[i].push_back(word);
    }
  }
  std::vector<double> xs(60);
  for (int i = 0; i < 60; ++i) xs[i] = 2 * i;
  const auto find = [&](int num_threads) {
    Appearance appearance = NodesWithAnImageEach(60, {{0, 1}, {3, 40}});
    EXPECT_TRUE(FindAmbiguity(VocabularyOf(words, 100), PlacesAt(xs), {.confusable_score_ratio = 0.9},
                              num_threads, nullptr, &appearance)
                    .ok());
    return appearance;
  };
  const Appearance one = find(1), four = find(4);
  EXPECT_FALSE(one.confusable.empty());
  EXPECT_EQ(one.nodes, four.nodes);
  EXPECT_EQ(one.confusable, four.confusable);
  const std::string path = testing::TempDir() + "ambiguity.db";
  ASSERT_TRUE(WriteAppearance(one, path).ok());
  const Result<Appearance> read = ReadAppearance(path);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->nodes, one.nodes);
  EXPECT_EQ(read->confusable, one.confusable);
}

TEST(FindAmbiguity, OnlyImagesThatThoseAroundThemResembleLeastAreScoredTwice) {
  struct Counter : Progress {
    void Begin(std::string_view, int64_t, std::string_view) override {}
    void Advance(int64_t num_items) override { num_advances += num_items; }
    void End() override {}
    int64_t num_advances = 0;
  };
  std::vector<std::vector<WordIdx>> words(20);  // of each, two thirds are the next one's too
  std::vector<double> xs(20);
  for (int i = 0; i < 20; ++i) {
    for (WordIdx word = 3 * i; word < 3 * i + 9; ++word) words[i].push_back(word);
    xs[i] = i;
  }
  Appearance appearance = NodesWithAnImageEach(20, {});
  Counter counter;
  ASSERT_TRUE(FindAmbiguity(VocabularyOf(words, 66), PlacesAt(xs), {}, 1, &counter, &appearance).ok());
  EXPECT_GE(counter.num_advances, 20);
  EXPECT_LE(counter.num_advances, 22);  // those below the first decile
}

TEST(FindAmbiguity, OptionsThatCannotBeMeantAreErrors) {
  Appearance appearance = NodesWithAnImageEach(4, {});
  for (const AmbiguityOptions& options :
       {AmbiguityOptions{.score_exponent = 0}, AmbiguityOptions{.confusable_score_ratio = 1.5},
        AmbiguityOptions{.confusable_distance_m = std::nan("")},
        AmbiguityOptions{.max_num_confusable = -1}}) {
    EXPECT_EQ(FindAmbiguity(VocabularyOf(kTwins, 10), {}, options, 1, nullptr, &appearance).error().code,
              ErrorCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace cairn::link_appearance
