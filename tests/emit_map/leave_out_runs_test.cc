#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/camera/panorama.h"
#include "stages/emit_map/leave_out/choose_runs.h"
#include "stages/emit_map/leave_out/left_out_map.h"
#include "stages/emit_map/leave_out/place_anew.h"
#include "tests/core/promise/wall_survey.h"

namespace cairn::emit_map {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

int NumTried(const LeftOutRuns& runs) {
  size_t num = 0;
  for (const LeftOutImages& round : runs.rounds) num += round.tried.size();
  return static_cast<int>(num);
}

// A view is 0.25 m, two images either side: with a run of five go nine, and of 100 at most 25 go at a time.
TEST(ChooseRuns, ImagesOfARunsViewsGoWithItAndOneInFourAtATime) {
  const auto runs = ChooseRuns(Row(100, 0.1, 2.5), {});
  ASSERT_TRUE(runs.ok());
  EXPECT_EQ(runs->num_runs, 5);
  ASSERT_EQ(runs->rounds.size(), 3U);
  EXPECT_THAT(runs->rounds[0].tried, ElementsAre(8, 9, 10, 11, 12, 28, 29, 30, 31, 32));
  EXPECT_THAT(runs->rounds[0].left_out,
              ElementsAre(6, 7, 8, 9, 10, 11, 12, 13, 14, 26, 27, 28, 29, 30, 31, 32, 33, 34));
  EXPECT_THAT(runs->rounds[1].tried, ElementsAre(48, 49, 50, 51, 52, 68, 69, 70, 71, 72));
  EXPECT_THAT(runs->rounds[2].tried, ElementsAre(88, 89, 90, 91, 92));
}

// Images 0 to 59 are those of a map that was updated: two runs of the others, with whose views also they go.
TEST(ChooseRuns, LandmarksOfAnEarlierMapAreNotTriedAndGoWithOthers) {
  std::set<size_t> of_map;
  for (size_t i = 0; i < 100; ++i) {
    if (i < 60 || i % 2 == 1) of_map.insert(i);
  }
  const auto runs = ChooseRuns(Row(100, 0.1, 2.5), {.hold_out = 0.2}, of_map);
  ASSERT_TRUE(runs.ok()) << runs.error().message;
  EXPECT_EQ(NumTried(*runs), 4);
  EXPECT_EQ(runs->num_runs, 2);
  EXPECT_THAT(runs->rounds[0].tried, ElementsAre(68, 70, 88, 90));
  EXPECT_THAT(runs->rounds[0].left_out, ElementsAre(66, 67, 68, 69, 70, 71, 72, 86, 87, 88, 89, 90, 91, 92));
  for (size_t i = 0; i < 98; ++i) of_map.insert(i);
  const auto none = ChooseRuns(Row(100, 0.1, 2.5), {}, of_map);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kNoData);
  EXPECT_THAT(none.error().message,
              HasSubstr("99 of the survey's 100 images are landmarks of an earlier map"));
}

TEST(ChooseRuns, ATenthIsTriedOfManyAndAtLeast24AndAtMost200) {
  const auto of = [](int num_images) {
    const auto runs = ChooseRuns(Row(num_images, 1, 2), {});
    EXPECT_TRUE(runs.ok());
    return *runs;
  };
  EXPECT_EQ(NumTried(of(20)), 10);  // half of few: five runs of two
  EXPECT_EQ(of(20).num_runs, 5);
  EXPECT_EQ(of(40).rounds.size(), 2U);  // ten runs of two, of which five are a quarter
  EXPECT_EQ(NumTried(of(120)), 24);     // four runs of six
  EXPECT_EQ(NumTried(of(480)), 48);     // four runs of twelve
  EXPECT_EQ(of(480).num_runs, 4);
  EXPECT_EQ(of(480).rounds.size(), 1U);
  EXPECT_EQ(NumTried(of(3000)), 204);  // seventeen runs of twelve
}

TEST(ChooseRuns, ARatioIsThatPartOfTheImagesAndAtLeastOne) {
  const Classes row = Row(100, 1, 2);
  EXPECT_EQ(NumTried(*ChooseRuns(row, {.hold_out = 0.3})), 30);
  const auto two = ChooseRuns(row, {.hold_out = 0.02});
  ASSERT_EQ(two->rounds.size(), 1U);
  EXPECT_THAT(two->rounds[0].tried, ElementsAre(49, 50));
  EXPECT_THAT(ChooseRuns(row, {.hold_out = 0.001})->rounds[0].tried, ElementsAre(50));
}

// A view is five images of twenty; that of two neighbours, six, are more than a quarter.
TEST(ChooseRuns, ARunWhoseViewsAreTooManyIsShorter) {
  const auto runs = ChooseRuns(Row(20, 0.1, 2.5), {.hold_out = 0.1});
  ASSERT_TRUE(runs.ok());
  ASSERT_EQ(runs->rounds.size(), 1U);
  EXPECT_THAT(runs->rounds[0].tried, ElementsAre(10));
  EXPECT_THAT(runs->rounds[0].left_out, ElementsAre(8, 9, 10, 11, 12));
}

TEST(ChooseRuns, SurveysThatAreTooSmallOrOneViewSaySo) {
  const auto few = ChooseRuns(Row(11, 1, 2), {});
  ASSERT_FALSE(few.ok());
  EXPECT_EQ(few.error().code, ErrorCode::kNoData);
  EXPECT_THAT(few.error().message,
              HasSubstr("has 11 images with poses, and runs are left out of 12 at least"));
  EXPECT_TRUE(ChooseRuns(Row(12, 1, 2), {}).ok());
  const auto one_view = ChooseRuns(Row(20, 0.01, 2), {});
  ASSERT_FALSE(one_view.ok());
  EXPECT_EQ(one_view.error().code, ErrorCode::kNoData);
  EXPECT_THAT(one_view.error().message, HasSubstr("more than a quarter of the others in its view"));
}

// Ten panoramas of four views, a metre apart, which all look the same way here.
TEST(ChooseRuns, OtherViewsOfAPanoramaGoWithIt) {
  Classes row = Row(40, 1, 2);
  for (size_t i = 0; i < row.images.size(); ++i)
    row.images[i].name = PanoramaViewName(std::to_string(i / 4), static_cast<int>(i % 4), 4);
  const auto runs = ChooseRuns(row, {.hold_out = 0.05});
  ASSERT_TRUE(runs.ok());
  ASSERT_EQ(runs->rounds.size(), 1U);
  EXPECT_THAT(runs->rounds[0].tried, ElementsAre(19, 20));
  EXPECT_THAT(runs->rounds[0].left_out, ElementsAre(16, 17, 18, 19, 20, 21, 22, 23));
}

// Adds a class that images see where it is; its stated place is another.
void AddSeen(const Eigen::Vector3d& truth, const Eigen::Vector3d& stated, const std::vector<ImageId>& seen_by,
             Classes* classes) {
  AddClass(stated, seen_by, 3, classes);
  for (Observation& observation : classes->classes.back().observations) {
    const Eigen::Vector3d p = classes->images[observation.image_id - 1].cam_from_world * truth;
    observation.keypoint.x = static_cast<float>(200 * p.x() / p.z() + 200);
    observation.keypoint.y = static_cast<float>(200 * p.y() / p.z() + 200);
  }
}

TEST(PlaceAnew, ClassesThatLostObservationsAreWhereTheOthersSeeThem) {
  Classes whole = WallSurvey(6, 0.5);
  const Eigen::Vector3d truth(1, 0.3, 4), stated(1.1, 0.3, 4.5);
  AddSeen(truth, stated, {1, 2, 3, 4, 5, 6}, &whole);  // loses one
  AddSeen(truth, stated, {2, 3, 4}, &whole);           // loses none
  AddSeen(truth, stated, {1, 2, 3}, &whole);           // is left with two of at least three
  whole.classes[0].observations[0].keypoint.x += 3;
  Classes rest = whole;
  for (FeatureClass& feature : rest.classes)
    std::erase_if(feature.observations, [](const Observation& seen) { return seen.image_id == 1; });
  rest.images.erase(rest.images.begin());
  PlaceAnew(whole, {}, 2, &rest);
  ASSERT_EQ(rest.classes.size(), 2U);
  EXPECT_LT((rest.classes[0].position - truth).norm(), 1e-4);
  // Five rays of half a metre's spacing, a pixel each, at four metres: some centimetres of depth.
  EXPECT_NEAR(std::sqrt(rest.classes[0].covariance(2, 2)), 0.05, 0.02);
  EXPECT_EQ(rest.classes[1].position, stated);
}

TEST(TriedImages, StateThePosesOfTheMapAsTheCaptureWould) {
  Classes classes = WallSurvey(3, 1);
  classes.camera_from_given.translation = {0, 0.25, 0};
  const std::vector<CaptureImage> images = TriedImages(classes, {.left_out = {1, 2}, .tried = {2}});
  ASSERT_EQ(images.size(), 1U);
  EXPECT_EQ(images[0].name, "2");
  EXPECT_LT((images[0].cam_from_world->translation - Eigen::Vector3d(-2, -0.25, 0)).norm(), 1e-12);
}

}  // namespace
}  // namespace cairn::emit_map
