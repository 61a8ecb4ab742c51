#include "stages/emit_map/choose/leave_out_images.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/colmap/colmap_database.h"
#include "core/features/descriptor_distance.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"
#include "tests/core/promise/wall_survey.h"

namespace cairn::emit_map {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

SurveyParts PartsOfExample(const EmitExample& example) {
  return {.world = example.world, .decomposition = example.decomposition, .appearance = example.appearance};
}

// The example without image `left_out`, and without the classes that then have one observation.
Classes Without(const EmitExample& example, ImageId left_out) {
  Classes classes = example.classes;
  std::erase_if(classes.images, [&](const SurveyImage& image) { return image.image_id == left_out; });
  for (FeatureClass& feature_class : classes.classes) {
    std::erase_if(feature_class.observations,
                  [&](const Observation& observation) { return observation.image_id == left_out; });
  }
  std::erase_if(classes.classes, [](const FeatureClass& row) { return row.observations.size() < 2; });
  return classes;
}

// Image 1 is all that saw classes 10 and 11 beside image 2: features 1 and 2 (classes 12, 13) become 0 and 1.
TEST(PartsOf, FeaturesOfVanishedClassesGoAndTheRestAreNumberedAnew) {
  const EmitExample example = MakeEmitExample();
  const Classes classes = Without(example, 1);
  ASSERT_EQ(classes.classes.size(), 2u);
  const SurveyParts parts = PartsOf(classes, PartsOfExample(example));
  EXPECT_THAT(parts.world.class_ids, ElementsAre(12, 13));
  EXPECT_THAT(parts.world.areas, ElementsAre(ElementsAre(1, 2), ElementsAre(1, 2)));
  ASSERT_EQ(parts.decomposition.regions.size(), 2u);
  EXPECT_THAT(parts.decomposition.regions[0].features, ElementsAre(0, 1));
  EXPECT_THAT(parts.decomposition.regions[1].features, ElementsAre(0));
  EXPECT_THAT(parts.decomposition.regions[1].stations, ElementsAre(0, 1));
  EXPECT_THAT(parts.world.station_images, ElementsAre(IsEmpty(), ElementsAre(2), ElementsAre(4)));
  EXPECT_TRUE(CheckWorld(parts.world).ok());
}

TEST(PartsOf, AMapOfThemCanBeMadeAndOfTheWholeWorldNot) {
  const EmitExample example = MakeEmitExample();
  const Classes classes = Without(example, 1);
  const SurveyParts parts = PartsOf(classes, PartsOfExample(example));
  const std::vector<char> keep(classes.classes.size(), 1);
  EXPECT_FALSE(
      EmitMap(classes, parts.world, example.decomposition, example.vocabulary, {}, nullptr, &keep).ok());
  const auto rows =
      EmitMap(classes, parts.world, parts.decomposition, example.vocabulary, {}, &*parts.appearance, &keep);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->landmarks.size(), 2u);
}

TEST(PartsOf, WholeSurveysStayAsTheyAre) {
  const EmitExample example = MakeEmitExample();
  const SurveyParts parts = PartsOf(example.classes, PartsOfExample(example));
  EXPECT_EQ(parts.world.class_ids, example.world.class_ids);
  EXPECT_EQ(parts.world.areas, example.world.areas);
  EXPECT_EQ(parts.world.station_images, example.world.station_images);
  for (size_t i = 0; i < parts.decomposition.regions.size(); ++i)
    EXPECT_EQ(parts.decomposition.regions[i].features, example.decomposition.regions[i].features);
  EXPECT_THAT(parts.appearance->Kept(), ElementsAre(1));
}

// Nodes 0 - 1 - 3 - 2 with images 1, 2, 4 and 3; node 1 is kept.
TEST(PartsOf, NeighboursOfAKeptPlaceWithoutImagesAreKept) {
  const EmitExample example = MakeEmitExample();
  SurveyParts parts = PartsOf(Without(example, 2), PartsOfExample(example));
  EXPECT_THAT(parts.appearance->Kept(), ElementsAre(0, 1, 3));
  EXPECT_THAT(parts.appearance->nodes[1].images, IsEmpty());
  EXPECT_EQ(parts.appearance->nodes[1].role, NodeRole::kDominating);
  // Without a place that was not kept, all other places keep their nodes.
  parts = PartsOf(Without(example, 4), PartsOfExample(example));
  EXPECT_THAT(parts.appearance->Kept(), ElementsAre(1));
  parts = PartsOf(Without(example, 1), {.world = example.world, .decomposition = example.decomposition});
  EXPECT_FALSE(parts.appearance.has_value());
}

TEST(ChooseLeftOut, ImagesOfTheTriedOnesViewGoWithThem) {
  const auto rounds = ChooseLeftOut(Row(100, 0.1, 2.5), 5);  // a view: 0.25 m, two images either side
  ASSERT_TRUE(rounds.ok());
  ASSERT_EQ(rounds->size(), 1U);
  EXPECT_THAT((*rounds)[0].tried, ElementsAre(10, 30, 50, 70, 90));
  EXPECT_THAT((*rounds)[0].left_out, ElementsAre(8, 9, 10, 11, 12, 28, 29, 30, 31, 32, 48, 49, 50, 51, 52, 68,
                                                 69, 70, 71, 72, 88, 89, 90, 91, 92));
}

TEST(ChooseLeftOut, ImagesThatAreNoRobotsAreOnlyLeftOut) {
  std::set<size_t> never_tried;
  for (size_t i = 0; i < 90; ++i) never_tried.insert(i);
  const auto rounds = ChooseLeftOut(Row(100, 0.1, 2.5), 2, never_tried);
  ASSERT_TRUE(rounds.ok());
  ASSERT_EQ(rounds->size(), 1U);
  EXPECT_THAT((*rounds)[0].tried, ElementsAre(92, 97));
  EXPECT_THAT((*rounds)[0].left_out, ElementsAre(90, 91, 92, 93, 94, 95, 96, 97, 98, 99));
}

TEST(ImagesOfThePast, AreThoseNearAViewOfALaterSession) {
  Classes classes = Row(60, 0.1, 2.5);  // twice a view: 0.5 m
  for (size_t i = 0; i < 60; ++i)
    classes.images[i].name = fmt::format("{}/{:02d}.png", i < 30 ? "a" : "b", i);
  EXPECT_THAT(ImagesOfThePast(classes), IsEmpty());  // no sessions
  classes.sessions = {"a", "b"};
  EXPECT_THAT(ImagesOfThePast(classes), ElementsAre(26, 27, 28, 29));
  classes.sessions = {"b", "a"};
  EXPECT_THAT(ImagesOfThePast(classes), ElementsAre(30, 31, 32, 33));
  // Images of no session are neither.
  classes.sessions = {"a", "c"};
  EXPECT_THAT(ImagesOfThePast(classes), IsEmpty());
}

TEST(ImagesOfThePast, AreTriedAllTheSameWhereTodayHasFew) {
  for (const int num_today : {24, 23}) {
    Classes classes = Row(2 * num_today, 0.1, 2.5);
    for (size_t i = 0; i < classes.images.size(); ++i)
      classes.images[i].name = fmt::format("{}/{:02d}.png", i % 2 == 0 ? "a" : "b", i);
    classes.sessions = {"a", "b"};
    EXPECT_EQ(ImagesOfThePast(classes).size(), num_today == 24 ? 24U : 0U);
  }
}

TEST(ChooseLeftOut, OneImageInFourAtATimeInAtMostSixRounds) {
  const auto rounds = ChooseLeftOut(Row(40, 0.1, 4.95), 40);  // nine images a view, ten at a time
  ASSERT_TRUE(rounds.ok());
  EXPECT_EQ(rounds->size(), kMaxNumRounds);
  std::set<size_t> tried;
  for (const LeftOutImages& round : *rounds) {
    EXPECT_LE(round.left_out.size(), 10U);
    EXPECT_TRUE(
        std::includes(round.left_out.begin(), round.left_out.end(), round.tried.begin(), round.tried.end()));
    for (const size_t image : round.tried) EXPECT_TRUE(tried.insert(image).second);
  }
  EXPECT_GE(tried.size(), 12U);
}

TEST(ChooseLeftOut, SurveysOfOneViewTryNothingAndSmallOnesAreRefused) {
  const auto one_view = ChooseLeftOut(Row(20, 0.01, 2), 5);
  ASSERT_TRUE(one_view.ok());
  EXPECT_THAT(*one_view, IsEmpty());
  EXPECT_TRUE(ChooseLeftOut(Row(12, 1, 2), 5).ok());
  const auto few = ChooseLeftOut(Row(11, 1, 2), 5);
  ASSERT_FALSE(few.ok());
  EXPECT_EQ(few.error().code, ErrorCode::kNoData);
  EXPECT_THAT(few.error().message, testing::HasSubstr("there are only 11; at least 12"));
}

// More classes than are described at a time, each seen by three images but the first, which image 3 lacks.
TEST(LeaveOutImages, ClassesAreDescribedByTheImagesThatAreLeft) {
  constexpr int kNumClasses = 16500, kNumImages = 3;
  const std::string path = testing::TempDir() + "/leave_out_images.db";
  Classes classes;
  classes.cameras.push_back({.camera_id = 1, .model = CameraModel::kPinhole});
  classes.cameras[0].width = 640, classes.cameras[0].height = 480;
  classes.cameras[0].params = {500, 500, 320, 240};
  std::vector<Features> features(kNumImages);
  for (int image = 0; image < kNumImages; ++image) {
    features[image].keypoints.resize(kNumClasses);
    features[image].descriptors.resize(kNumClasses, kSiftDescriptorDim);
    for (int i = 0; i < kNumClasses; ++i) {
      for (int k = 0; k < kSiftDescriptorDim; ++k)
        features[image].descriptors(i, k) = static_cast<uint8_t>((7 * i + 13 * k * (image + 1)) % 251 / 4);
    }
    classes.images.push_back({.image_id = static_cast<ImageId>(image + 1), .name = {}, .camera_id = 1});
  }
  for (int i = 0; i < kNumClasses; ++i) {
    FeatureClass& row = classes.classes.emplace_back();
    row.class_id = i + 1;
    for (ImageId image = 1; image <= (i == 0 ? 2 : 3); ++image)
      row.observations.push_back({.image_id = image, .keypoint_idx = static_cast<KeypointIdx>(i)});
  }
  ASSERT_TRUE(WriteDatabase(path, kColmapSchema, [&](SQLite::Database& database) -> Status {
                WriteDatabaseCamera(database, classes.cameras[0]);
                for (ImageId image = 1; image <= kNumImages; ++image) {
                  WriteDatabaseImage(database, {image, std::to_string(image) + ".png", 1});
                  WriteDatabaseFeatures(database, image, features[image - 1]);
                }
                return Ok();
              }).ok());
  const auto survey = LeaveOutImages(classes, path, {.left_out = {2}, .tried = {2}});
  ASSERT_TRUE(survey.ok()) << survey.error().message;
  ASSERT_EQ(survey->classes.classes.size(), static_cast<size_t>(kNumClasses));
  EXPECT_EQ(survey->classes.classes[0].descriptor, classes.classes[0].descriptor) << "as it was";
  for (int i = 1; i < kNumClasses; ++i) {
    const Eigen::Matrix<double, 1, Eigen::Dynamic> sum =
        features[0].descriptors.row(i).cast<double>() + features[1].descriptors.row(i).cast<double>();
    ASSERT_EQ(survey->classes.classes[i].descriptor, MeanDescriptor(sum, 0)) << i;
  }
}

TEST(ErrorRatio, IsTheGeometricMeanOverImagesThatBothLocalize) {
  const LeftOutTrial reference{.images = {{true, 0.01, 9}, {true, 0.02, 9}, {true, 0.5, 9}, {}}};
  const LeftOutTrial trial{.images = {{true, 0.02, 9}, {true, 0.16, 9}, {}, {true, 0.5, 9}}};
  EXPECT_NEAR(ErrorRatio(trial, reference, 1e-9), 4, 1e-12);  // 2 and 8 times as large
  EXPECT_NEAR(ErrorRatio(reference, trial, 1e-9), 0.25, 1e-12);
  EXPECT_DOUBLE_EQ(ErrorRatio(trial, trial, 1e-9), 1);
  EXPECT_DOUBLE_EQ(ErrorRatio({.images = {{true, 0.1, 9}, {}}}, {.images = {{}, {true, 0.1, 9}}}, 1e-9), 1);
}

TEST(ErrorRatio, ErrorsBelowTheLeastCountAsIt) {
  const LeftOutTrial exact{.images = {{true, 0, 9}}}, off{.images = {{true, 0.1, 9}}};
  EXPECT_NEAR(ErrorRatio(off, exact, 0.001), 100, 1e-9);
  EXPECT_NEAR(ErrorRatio(exact, off, 0.001), 0.01, 1e-12);
  EXPECT_DOUBLE_EQ(ErrorRatio(off, exact, 0.2), 1);
}

TEST(LeftOutTrial, SumsUpAndCountsFiftyInliersAtMost) {
  LeftOutTrial trial{.images = {{true, 0.3, 20}, {}, {true, 0.1, 80}}};
  trial.Add({.images = {{true, 0.2, 30}}});
  EXPECT_EQ(trial.NumTried(), 4);
  EXPECT_EQ(trial.NumRight(), 3);
  EXPECT_DOUBLE_EQ(trial.MedianErrorM(), 0.2);
  EXPECT_DOUBLE_EQ(trial.MeanMargin(), 0.5);  // (20 + 0 + 50 + 30) / 200
  EXPECT_EQ(LeftOutTrial().NumTried(), 0);
  EXPECT_EQ(LeftOutTrial().MedianErrorM(), 0);
  EXPECT_EQ(LeftOutTrial().MeanMargin(), 0);
}

}  // namespace
}  // namespace cairn::emit_map
