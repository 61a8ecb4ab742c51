#include "stages/emit_map/images_of_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"
#include "tests/core/promise/wall_survey.h"

namespace cairn::emit_map {
namespace {

using testing::ElementsAre;

// Image 1 is of an earlier session, and image 2, now a little beside it, shows its view.
EmitExample MakeExampleOfTwoSessions() {
  EmitExample example = MakeEmitExample();
  example.classes.sessions = {"old", "new"};
  example.classes.images[0].name = "old/1.png";
  example.classes.images[1].name = "new/2.png";
  example.classes.images[2].name = "new/4.png";
  example.classes.images[1].cam_from_world.translation = {-1.1, 0, 0};
  return example;
}

TEST(ChooseImages, ListsThoseOfTodayAndThoseThatProveAChange) {
  EmitExample example = MakeExampleOfTwoSessions();
  ImagesOfMap images = ChooseImages(example.classes, false);
  EXPECT_THAT(images.listed, ElementsAre(1, 2));
  EXPECT_THAT(images.row_of_image, ElementsAre(0, 0, 1));
  EXPECT_FALSE(images.ListsAll());
  EXPECT_FALSE(images.Lists(0));
  EXPECT_TRUE(images.Lists(1));
  EXPECT_TRUE(images.Lists(2));

  EXPECT_TRUE(ChooseImages(example.classes, true).ListsAll());
  example.classes.changes = {{.session = 1, .image_before = 1, .image_after = 4}};
  EXPECT_TRUE(ChooseImages(example.classes, false).ListsAll());
  example.classes.changes = {{.session = 1, .image_before = 2, .image_after = 1}};
  EXPECT_TRUE(ChooseImages(example.classes, false).ListsAll());
  example.classes.changes = {{.session = 1, .image_before = 2, .image_after = 4}};
  EXPECT_FALSE(ChooseImages(example.classes, false).ListsAll());
  example.classes.sessions.clear();
  images = ChooseImages(example.classes, false);
  EXPECT_THAT(images.row_of_image, ElementsAre(0, 1, 2));
}

TEST(EmitMap, ImagesOfThePastAreShownByThoseOfToday) {
  EmitExample example = MakeExampleOfTwoSessions();
  // Image 1 alone sees a class that image 2 would see where it stands, and one that lies outside of its view.
  AddClass({1.5, 0, 2}, {1}, 3, &example.classes);
  AddClass({-0.92, 0, 2}, {1}, 3, &example.classes);
  example.classes.classes[4].class_id = 14;
  example.classes.classes[5].class_id = 15;
  const auto emit = [&] {
    return *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, {"all"},
                    &example.appearance);
  };
  const auto classes_of = [](const MapRows& rows, size_t image) {
    std::vector<ClassId> ids;
    for (const LandmarkIdx landmark : rows.images[image].landmarks)
      ids.push_back(rows.landmarks[landmark].class_id);
    std::sort(ids.begin(), ids.end());
    return ids;
  };
  MapRows rows = emit();
  ASSERT_EQ(rows.images.size(), 2U);
  EXPECT_EQ(rows.images[0].image_id, 2U);
  EXPECT_THAT(classes_of(rows, 0), ElementsAre(10, 11, 12, 13, 14));
  EXPECT_THAT(classes_of(rows, 1), ElementsAre(12, 13));
  EXPECT_TRUE(std::is_sorted(rows.images[0].landmarks.begin(), rows.images[0].landmarks.end()));
  EXPECT_EQ(rows.landmarks.size(), 6U);  // no landmark is lost with an image
  EXPECT_EQ(rows.images[0].station, 1);
  EXPECT_EQ(rows.stations.size(), 3U);
  ASSERT_EQ(rows.appearance.size(), 2U);
  EXPECT_THAT(rows.appearance[0].images, ElementsAre(0));

  example.classes.sessions.clear();
  rows = emit();
  ASSERT_EQ(rows.images.size(), 3U);
  EXPECT_THAT(classes_of(rows, 0), ElementsAre(10, 11, 14, 15));
  EXPECT_THAT(classes_of(rows, 1), ElementsAre(10, 11, 12, 13));
}

TEST(EmitMap, StationsOfImagesThatNobodyKnowsAreRefusedAllTheSame) {
  EmitExample example = MakeExampleOfTwoSessions();
  example.world.station_images[0] = {3};
  const auto rows =
      EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, {"all"});
  ASSERT_FALSE(rows.ok());
  EXPECT_THAT(rows.error().message, testing::HasSubstr("station 0 has image 3"));
}

TEST(EmitMap, PromisesNameTheImagesThatAreListed) {
  const EmitExample example = MakeExampleOfTwoSessions();
  Promises promises;
  promises.findings.nodes = {{.image = 1, .other_image = 2, .region = 0, .probability = 0.5}};
  promises.regions = {{.images = {0, 2}, .classes = {0, 2}}};
  const std::vector<char> keep(example.classes.classes.size(), 1);
  const auto rows = EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                            {"fewest"}, nullptr, &keep, &promises);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->findings.promise->nodes[0].image, 0);
  EXPECT_EQ(rows->findings.promise->nodes[0].other_image, 1);
  EXPECT_THAT(rows->regions[0].stations, ElementsAre(1, 2));  // image 2's, which shows image 1's view
}

// Nodes 0 - 1 - 3 - 2 with images 1, 2, 4 and 3; node 1 is kept.
TEST(OfListedImages, NodesOfThePastBecomeOneWithThoseThatShowTheirViews) {
  EmitExample example = MakeExampleOfTwoSessions();
  const ImagesOfMap images = ChooseImages(example.classes, false);
  example.appearance.nodes[0].role = NodeRole::kRestored;
  example.appearance.nodes[1].role = NodeRole::kDropped;
  example.appearance.graph = AppearanceGraph(4, {{0, 1, 20}, {0, 3, 5}, {1, 3, 30}, {2, 3, 40}});
  example.appearance.confusable = {{0, 1, 0.9}, {0, 2, 0.75}, {0, 3, 0.5}, {1, 3, 0.25}};
  const Appearance merged = OfListedImages(example.appearance, example.classes, images);
  ASSERT_EQ(merged.nodes.size(), 3U);
  EXPECT_THAT(merged.nodes[0].images, ElementsAre(2));
  EXPECT_EQ(merged.nodes[0].role, NodeRole::kRestored);
  EXPECT_EQ(merged.nodes[0].entropy, 0.5);
  EXPECT_THAT(merged.nodes[1].images, ElementsAre(3));  // of no pose: it stays as it is
  EXPECT_THAT(merged.graph.Neighbours(0), ElementsAre(AppearanceGraph::Neighbour{2, 35}));
  EXPECT_THAT(merged.graph.Neighbours(1), ElementsAre(AppearanceGraph::Neighbour{2, 40}));
  EXPECT_THAT(merged.confusable, ElementsAre(ConfusablePair{0, 1, 0.75}, ConfusablePair{0, 2, 0.5}));

  // The first node may be the one that shows the view.
  EmitExample reversed = MakeExampleOfTwoSessions();
  reversed.classes.images[0].name = "new/1.png";
  reversed.classes.images[1].name = "old/2.png";
  const ImagesOfMap first = ChooseImages(reversed.classes, false);
  EXPECT_THAT(first.row_of_image, ElementsAre(0, 0, 1));
  const Appearance by_first = OfListedImages(reversed.appearance, reversed.classes, first);
  ASSERT_EQ(by_first.nodes.size(), 3U);
  EXPECT_THAT(by_first.nodes[0].images, ElementsAre(1));
  EXPECT_EQ(by_first.nodes[0].role, NodeRole::kDominating);
  EXPECT_TRUE(by_first.graph.AreLinked(0, 2));

  // A kept node stays what it is, and a node with another image of today stays as well.
  example.appearance.nodes[1].role = NodeRole::kDominating;
  EXPECT_EQ(OfListedImages(example.appearance, example.classes, images).nodes[0].role, NodeRole::kDominating);
  example.appearance.nodes[0].images = {1, 4};
  example.appearance.nodes[3].images = {};
  EXPECT_EQ(OfListedImages(example.appearance, example.classes, images).nodes.size(), 4U);
}

}  // namespace
}  // namespace cairn::emit_map
