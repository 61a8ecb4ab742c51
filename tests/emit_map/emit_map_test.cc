#include "stages/emit_map/emit_map.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_documents.h"
#include "stages/emit_map/quantize_descriptors.h"
#include "tests/core/map/example.h"

namespace cairn::emit_map {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Result<MapRows> Emit(const EmitExample& example, const std::string& landmarks = "regions") {
  return EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, {landmarks});
}

std::vector<ClassId> ClassIds(const MapRows& rows) {
  std::vector<ClassId> ids;
  for (const MapLandmark& landmark : rows.landmarks) ids.push_back(landmark.class_id);
  return ids;
}

// What max_bytes and the fewest landmarks choose from.
TEST(KeptClasses, AreThoseOfRegionsOrAll) {
  const EmitExample example = MakeEmitExample();
  const auto num_kept = [&](const std::string& landmarks) {
    const auto kept =
        *KeptClasses(example.classes, example.world, example.decomposition, {.landmarks = landmarks});
    EXPECT_EQ(kept.size(), example.classes.classes.size());
    return static_cast<size_t>(std::count(kept.begin(), kept.end(), 1));
  };
  EXPECT_EQ(num_kept("regions"), Emit(example, "regions")->landmarks.size());
  EXPECT_LT(num_kept("regions"), example.classes.classes.size());
  EXPECT_EQ(num_kept("all"), example.classes.classes.size());
  EXPECT_EQ(num_kept("fewest"), example.classes.classes.size());
}

TEST(EmitMap, FewestLandmarksHaveToBeNamed) {
  const EmitExample example = MakeEmitExample();
  const auto rows = EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, {});
  ASSERT_FALSE(rows.ok());
  EXPECT_EQ(rows.error().code, ErrorCode::kInvalidArgument);
  std::vector<char> keep(example.classes.classes.size(), 0);
  keep[1] = 1;
  const MapRows named =
      *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, {}, nullptr, &keep);
  EXPECT_EQ(named.landmark_choice, "fewest");
  ASSERT_EQ(named.landmarks.size(), 1U);
  EXPECT_EQ(named.landmarks[0].class_id, example.classes.classes[1].class_id);
}

TEST(AddChanges, RoundsPlacesAndNamesSessionsAndImagesByTheMapsIndices) {
  EmitExample example = MakeEmitExample();
  example.classes.sessions = {"old", "new", "newer"};
  example.classes.changes = {
      {.session = 1,
       .position = {1.23449, -0.0006, 2},
       .radius_m = 0.25051,
       .num_vanished = 20,
       .num_appeared = 3,
       .image_before = 4,
       .image_after = 2,
       .moved_to = 1,
       .num_moved = 12},
      {.session = 1, .position = {1e9, 0, 0}, .num_vanished = 17, .moved_to = 0},
      {.session = 1, .num_vanished = 15, .image_before = 3, .image_after = 0, .moved_to = 0, .num_moved = 11},
      {.session = 2, .num_vanished = 11}};
  MapRows rows = *Emit(example);
  rows.sessions = {"older", "old", "new"};  // "newer" is not of this map
  AddChanges(example.classes, &rows);
  EXPECT_THAT(rows.findings.changes,
              ElementsAre(MapChange{.session = 2,
                                    .position = {1.234, -0.001, 2},
                                    .radius_m = 0.251,
                                    .num_vanished = 20,
                                    .num_appeared = 3,
                                    .image_before = 2,
                                    .image_after = 1},
                          MapChange{.session = 2, .num_vanished = 15, .moved_to = 0, .num_moved = 11}));
  EXPECT_TRUE(CheckMapRows(rows).ok());
}

TEST(EmitMap, KeepsTheClassesOfRegionsOrderedByFirstRegion) {
  const Result<MapRows> rows = Emit(MakeEmitExample());
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_THAT(ClassIds(*rows),
              ElementsAre(12, 13, 10));  // region 0: 12 and 13; region 1 adds 10; 11 is in none
  EXPECT_THAT(rows->regions[0].landmarks, ElementsAre(0, 1));
  EXPECT_THAT(rows->regions[1].landmarks, ElementsAre(0, 2));
  EXPECT_THAT(rows->regions[1].stations, ElementsAre(0, 1));
  EXPECT_EQ(rows->descriptors(2, 0), 0);
  EXPECT_EQ(rows->descriptors(1, 0), 30);
}

TEST(EmitMap, AllKeepsEveryClassAndTheSameRegions) {
  const Result<MapRows> rows = Emit(MakeEmitExample(), "all");
  ASSERT_TRUE(rows.ok());
  EXPECT_THAT(ClassIds(*rows), ElementsAre(12, 13, 10, 11));
  EXPECT_THAT(rows->regions[1].landmarks, ElementsAre(0, 2));
  EXPECT_THAT(rows->images[0].landmarks, ElementsAre(2, 3));
}

TEST(EmitMap, ImagesKnowTheirStationAndLandmarks) {
  const MapRows rows = *Emit(MakeEmitExample());
  ASSERT_EQ(rows.images.size(), 3u);
  EXPECT_THAT(rows.images[0].landmarks, ElementsAre(2));
  EXPECT_THAT(rows.images[1].landmarks, ElementsAre(0, 1, 2));
  EXPECT_EQ(rows.images[2].image_id, 4u);
  EXPECT_EQ(rows.images[2].station, 2);
  EXPECT_FALSE(rows.stations[2].is_covered);
  EXPECT_TRUE(rows.stations[1].is_covered);
}

TEST(EmitMap, ScaleIsTheKeypointsSizeInSpace) {
  // Keypoints of 3 px, seen from 2 m with a focal length of 100 px: 6 cm.
  EXPECT_NEAR(Emit(MakeEmitExample())->landmarks[0].scale_m, 0.06, 1e-9);
}

TEST(EmitMap, SmallMapHasNoVocabulary) { EXPECT_TRUE(Emit(MakeEmitExample())->vocabulary.nodes.empty()); }

TEST(EmitMap, VocabularyKeepsTheWordsOfLandmarksOnly) {
  // All landmarks fall to the first of the two words, so that the other is left out; images 1, 2 and 4 see
  // landmarks {2}, {0, 1, 2} and {0, 1}.
  const EmitExample example = MakeEmitExample();
  const EmitMapOptions options{
      .landmarks = "regions", .min_num_landmarks_for_words = 0, .landmarks_per_word = 1};
  const MapRows rows =
      *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, options);
  EXPECT_THAT(rows.vocabulary.document_ids, ElementsAre(1, 2, 4));
  ASSERT_EQ(rows.vocabulary.num_words(), 1);
  EXPECT_EQ(rows.vocabulary.depth, 1);
  EXPECT_EQ(rows.vocabulary.centres(1, 0), 255);
  EXPECT_THAT(rows.vocabulary.inverted_files[0], ElementsAre(Posting{0, 1}, Posting{1, 3}, Posting{2, 2}));
}

TEST(EmitMap, WordsAreNotSplitBelowTheirNumberOfLandmarks) {
  const EmitExample example = MakeEmitExample();
  const EmitMapOptions options{
      .landmarks = "regions", .min_num_landmarks_for_words = 0, .landmarks_per_word = 3};
  const MapRows rows =
      *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, options);
  EXPECT_EQ(rows.vocabulary.nodes.size(), 1u);  // the root is the only word
  EXPECT_EQ(rows.vocabulary.depth, 0);
}

TEST(EmitMap, AppearanceKeepsLinksOfKeptImagesAndLeavesOutOthers) {
  const EmitExample example = MakeEmitExample();
  const MapRows rows = *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                {.landmarks = "regions"}, &example.appearance);
  // Image 3 has no pose; the others are images 0 to 2 of the map.
  using Link = MapAppearanceNode::Link;
  ASSERT_EQ(rows.appearance.size(), 3u);
  EXPECT_EQ(rows.appearance[0], (MapAppearanceNode{{0}, false, {Link{1, 20}}, 0.25, {{2, 0.5}}}));
  EXPECT_EQ(rows.appearance[1], (MapAppearanceNode{{1}, true, {Link{2, 30}}, 0.5, {}}));
  EXPECT_EQ(rows.appearance[2], (MapAppearanceNode{{2}, false, {}, 1, {}}));
}

TEST(EmitMap, RegionsHaveTheMeanEntropyOfTheirStationsImages) {
  EmitExample example = MakeEmitExample();
  // Stations 0, 1, 2 have images 1, 2, 4 with 0.25, 0.5 and 1; the regions stations 1, 2 and 0, 1.
  EXPECT_THAT(EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                      {.landmarks = "regions"}, &example.appearance)
                  ->findings.region_entropies,
              ElementsAre(RegionEntropy{0, 0.75}, RegionEntropy{1, 0.375}));
  for (AppearanceNode& node : example.appearance.nodes) node.entropy = std::nullopt;
  example.appearance.confusable.clear();
  EXPECT_TRUE(EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                      {.landmarks = "regions"}, &example.appearance)
                  ->findings.region_entropies.empty());
}

TEST(EmitMap, SurveyWordsCountAllFeaturesOfTheMapsImages) {
  const EmitExample example = MakeEmitExample();
  const MapRows rows = *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                {.landmarks = "regions", .words = "survey"}, &example.appearance);
  // Image 3 is not in the map; the documents are images 1, 2, 4.
  EXPECT_THAT(rows.vocabulary.document_ids, ElementsAre(1, 2, 4));
  EXPECT_THAT(rows.vocabulary.inverted_files[0], ElementsAre(Posting{0, 2}));
  EXPECT_THAT(rows.vocabulary.inverted_files[1], ElementsAre(Posting{2, 1}));
  EXPECT_EQ(rows.vocabulary.nodes.size(), 3u);
  EXPECT_EQ(EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                    {.landmarks = "regions", .words = "survey", .documents = "kept"}, &example.appearance)
                .error()
                .code,
            ErrorCode::kInvalidArgument);
}

TEST(EmitMap, KeptDocumentsAloneHavePostings) {
  const EmitExample example = MakeEmitExample();
  EmitMapOptions options{
      .landmarks = "regions", .min_num_landmarks_for_words = 0, .landmarks_per_word = 1, .documents = "kept"};
  const MapRows rows = *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                options, &example.appearance);
  EXPECT_THAT(rows.vocabulary.document_ids, ElementsAre(2));
  EXPECT_THAT(rows.vocabulary.inverted_files[0], ElementsAre(Posting{0, 3}));
  EXPECT_THAT(rows.images[0].landmarks, ElementsAre(2)) << "priors and regions still lead to every image";
  const MapRows all = WithAllDocuments(rows);
  EXPECT_THAT(all.vocabulary.document_ids, ElementsAre(1, 2, 4));
  EXPECT_THAT(all.vocabulary.inverted_files[0], ElementsAre(Posting{0, 1}, Posting{1, 3}, Posting{2, 2}));

  const Result<MapRows> without =
      EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, options);
  ASSERT_FALSE(without.ok());
  EXPECT_EQ(without.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(without.error().message, HasSubstr("--appearance"));
}

TEST(QuantizeDescriptorValues, FewValuesStayAsTheyAre) {
  DescriptorMatrix descriptors = DescriptorMatrix::Zero(2, kSiftDescriptorDim);
  descriptors.row(1).setConstant(77);
  descriptors(0, 5) = 200;
  const DescriptorMatrix before = descriptors;
  QuantizeDescriptorValues(2, &descriptors);
  EXPECT_EQ(descriptors, before);
}

TEST(QuantizeDescriptorValues, LevelsAreTheMeansOfTheirValues) {
  // 10, 12 and 200, 202, equally often: two levels, 11 and 201.
  DescriptorMatrix descriptors(4, kSiftDescriptorDim);
  for (int row = 0; row < 4; ++row) {
    descriptors.row(row).setConstant(static_cast<uint8_t>((row < 2 ? 10 : 200) + 2 * (row % 2)));
  }
  QuantizeDescriptorValues(1, &descriptors);
  EXPECT_EQ(descriptors(0, 0), 11);
  EXPECT_EQ(descriptors(1, 0), 11);
  EXPECT_EQ(descriptors(2, 0), 201);
  EXPECT_EQ(descriptors(3, 0), 201);
}

TEST(EmitMap, ImageInTheWorldWithoutClassesIsAnError) {
  EmitExample example = MakeEmitExample();
  example.world.station_images[2] = {9};
  EXPECT_THAT(Emit(example).error().message, HasSubstr("image 9"));
}

TEST(EmitMap, RegionsOfAnotherWorldAreAnError) {
  EmitExample example = MakeEmitExample();
  example.decomposition.regions[0].features = {7};
  EXPECT_EQ(Emit(example).error().code, ErrorCode::kInvalidArgument);
  example = MakeEmitExample();
  example.decomposition.regions[0].stations = {8};
  EXPECT_EQ(Emit(example).error().code, ErrorCode::kInvalidArgument);
  example = MakeEmitExample();
  example.world.class_ids[1] = 99;
  EXPECT_THAT(Emit(example).error().message, HasSubstr("class 99"));
}

TEST(EmitMap, NoRegionsMeansNoMapUnlessAllAreKept) {
  EmitExample example = MakeEmitExample();
  example.decomposition.regions.clear();
  example.decomposition.lower_bound.reset();
  EXPECT_EQ(Emit(example).error().code, ErrorCode::kNoData);
  EXPECT_TRUE(Emit(example, "all").ok());
}

TEST(EmitMap, PartsOfOneClassAreOneLandmark) {
  EmitExample example = MakeEmitExample();
  example.world.class_ids = {10, 12, 12};
  EXPECT_THAT(Emit(example)->regions[0].landmarks, ElementsAre(0));
}

TEST(BitsOfStep, AreThoseWhoseLevelsAreAsFine) {
  EXPECT_EQ(BitsOfStep(100), 1);
  EXPECT_EQ(BitsOfStep(64), 1);
  EXPECT_EQ(BitsOfStep(63), 2);
  EXPECT_EQ(BitsOfStep(24), 3);
  EXPECT_EQ(BitsOfStep(16), 4);
  EXPECT_EQ(BitsOfStep(4), 6);
  EXPECT_EQ(BitsOfStep(1), 6) << "the most that there are";
}

}  // namespace
}  // namespace cairn::emit_map
