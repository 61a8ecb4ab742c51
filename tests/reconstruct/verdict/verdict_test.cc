#include "stages/reconstruct/verdict/verdict.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/reconstruct/verdict/seen_from_above.h"
#include "stages/reconstruct/verdict/verdict_text.h"
#include "tests/reconstruct/verdict/model_of_sights.h"

namespace cairn::reconstruct {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

ColmapModel Drive(int num_images, std::vector<ModelSight> more = {}) {
  std::vector<ModelSight> sights = SightsOfNext(num_images, 100);
  sights.insert(sights.end(), more.begin(), more.end());
  return ModelOfSights(NumberedNames(num_images), PlacesInARow(num_images), sights);
}

std::vector<std::string> NamesOf(const Verdict& verdict) {
  std::vector<std::string> names;
  for (const JoinedImage& image : verdict.images) names.push_back(image.name);
  return names;
}

TEST(Judge, ADriveWithoutALoopIsWholeAndSaysThatItsEndIsFree) {
  const Verdict verdict = JudgeModels({Drive(12)});
  EXPECT_TRUE(verdict.is_whole());
  EXPECT_TRUE(verdict.is_drive);
  EXPECT_DOUBLE_EQ(verdict.way, 11);
  EXPECT_DOUBLE_EQ(verdict.median_step, 1);
  EXPECT_THAT(verdict.links, SizeIs(11));
  EXPECT_EQ(verdict.images[0].num_points, 100);
  EXPECT_EQ(verdict.images[5].num_points, 200);
  EXPECT_THAT(verdict.weak_links, IsEmpty());
  EXPECT_EQ(WholeText(verdict),
            "whole: all 12 images are joined; a way of 11.0 m that never comes back to what it has seen: "
            "nothing bounds how far its end is off");
}

// Each frame three times, as films of another rate have them: most steps are none, and all others would be
// long.
TEST(Judge, RepeatedFramesAreNoSteps) {
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 12; ++i) places.emplace_back(i / 3, 1e-4 * (i % 3), 0);
  const Verdict verdict = JudgeModels({ModelOfSights(NumberedNames(12), places, SightsOfNext(12, 100))});
  EXPECT_NEAR(verdict.median_step, 1, 1e-3);
  EXPECT_THAT(verdict.long_steps, IsEmpty());
  // Nothing moves at all.
  const Verdict standing = JudgeModels(
      {ModelOfSights(NumberedNames(4), std::vector<Eigen::Vector3d>(4, {1, 2, 3}), SightsOfNext(4, 100))});
  EXPECT_EQ(standing.median_step, 0);
  EXPECT_THAT(standing.long_steps, IsEmpty());
}

TEST(Judge, LoopsHoldADriveTogether) {
  const Verdict verdict = JudgeModels({Drive(30, {{{0, 15}, 60}, {{2, 29}, 80}})});
  ASSERT_THAT(verdict.loops, SizeIs(2));
  EXPECT_THAT(verdict.open_stretches, IsEmpty());
  EXPECT_THAT(VerdictLines(verdict),
              testing::Contains("2 loops, of 15.0 m (0.jpg to 15.jpg, which have 60 points in common) to "
                                "27.0 m (2.jpg to 29.jpg, which have 80 points in common)"));
  EXPECT_THAT(WholeText(verdict), HasSubstr("a way of 29.0 m that 2 loops hold together"));
}

TEST(Judge, NamesFollowEachOtherAsNumbersDoWhateverTheModelsOrder) {
  ColmapModel model = Drive(12, {{{0, 11}, 90}});
  const Verdict verdict = JudgeModels({model});
  EXPECT_EQ(NamesOf(verdict), NumberedNames(12));
  std::reverse(model.images.begin(), model.images.end());
  std::reverse(model.points.begin(), model.points.end());
  const Verdict again = JudgeModels({model});
  EXPECT_EQ(VerdictLines(again), VerdictLines(verdict));
  EXPECT_EQ(NamesOf(again), NamesOf(verdict));
}

// 0 1 . . 4 5 . : two are missing within, one at the end, and one of a folder that is not joined at all.
TEST(Judge, MissingImagesStandBetweenTheirNeighboursByName) {
  const ColmapModel model = ModelOfSights({"0.jpg", "1.jpg", "4.jpg", "5.jpg"},
                                          {{0, 0, 0}, {1, 0, 0}, {7, 0, 0}, {8, 0, 0}}, SightsOfNext(4, 100));
  const Verdict verdict = JudgeModels(
      {model}, {{"2.jpg", "no matches"}, {"3.jpg", "no pose"}, {"10.jpg", "dark"}, {"a/2.jpg", "dark"}});
  EXPECT_FALSE(verdict.is_whole());
  ASSERT_THAT(verdict.missing, SizeIs(4));
  EXPECT_EQ(verdict.missing[0].name, "2.jpg");
  EXPECT_EQ(verdict.missing[0].reason, "no matches");
  EXPECT_EQ(verdict.missing[0].before, 1);
  EXPECT_EQ(verdict.missing[0].after, 2);
  EXPECT_EQ(verdict.missing[1].before, 1);
  EXPECT_EQ(verdict.missing[1].after, 2);
  EXPECT_EQ(verdict.missing[2].before, 3);
  EXPECT_EQ(verdict.missing[2].after, -1);
  EXPECT_EQ(verdict.missing[3].before, -1);
  EXPECT_EQ(verdict.missing[3].after, -1);
  EXPECT_EQ(verdict.links[1].num_missing, 2);
  EXPECT_THAT(verdict.long_steps, IsEmpty()) << "6 m with two images missing are two metres each";
  EXPECT_THAT(WholeText(verdict), HasSubstr("not whole: 4 of 8 images are joined, 4 to no other; a way of"));
}

TEST(Judge, StepsFarLongerThanTheMedianAreNamed) {
  std::vector<Eigen::Vector3d> places = PlacesInARow(12);
  for (int i = 6; i < 12; ++i) places[i].x() += 4;  // a step of 5 m, which is not yet more
  EXPECT_THAT(JudgeModels({ModelOfSights(NumberedNames(12), places, SightsOfNext(12, 100))}).long_steps,
              IsEmpty());
  for (int i = 6; i < 12; ++i) places[i].x() += 0.1;
  const Verdict verdict = JudgeModels({ModelOfSights(NumberedNames(12), places, SightsOfNext(12, 100))});
  ASSERT_THAT(verdict.long_steps, ElementsAre(5));
  EXPECT_THAT(VerdictLines(verdict),
              testing::Contains("beside the median step of 1.0 m long: 5.jpg to 6.jpg (5.1 m)"));
}

// What joins 4 and 5 is what 3 and 5 see, too: 4 is weak, the drive is not.
TEST(Judge, ABlurredImageIsWeakButDoesNotPartTheDrive) {
  std::vector<ModelSight> sights;
  for (int i = 0; i + 1 < 10; ++i) {
    const bool is_blurred = i == 3 || i == 4;
    sights.push_back({{i, i + 1}, is_blurred ? 20 : 100});
  }
  sights.push_back({{3, 5}, 80});
  const Verdict verdict = JudgeModels({ModelOfSights(NumberedNames(10), PlacesInARow(10), sights)});
  EXPECT_TRUE(verdict.is_drive);
  EXPECT_THAT(verdict.weak_links, IsEmpty());
  EXPECT_EQ(verdict.links[3].num_points, 100) << "20 that 3 and 4 see, 80 that 3 and 5 see";
  EXPECT_THAT(verdict.weak_images, ElementsAre(4));
  EXPECT_THAT(VerdictLines(verdict), testing::Contains("few points hold 4.jpg (40)"));
}

TEST(Judge, LinksOfFewPointsAreWeakTheWeakestFirst) {
  std::vector<ModelSight> sights = SightsOfNext(12, 100);
  sights[2].num_points = 49;
  sights[6].num_points = 12;
  sights[8].num_points = 50;
  const Verdict verdict = JudgeModels({ModelOfSights(NumberedNames(12), PlacesInARow(12), sights)});
  EXPECT_THAT(verdict.weak_links, ElementsAre(6, 2));
  EXPECT_THAT(VerdictLines(verdict),
              testing::Contains("few points join 6.jpg to 7.jpg (12), 2.jpg to 3.jpg (49)"));
  EXPECT_THAT(WholeText(verdict), HasSubstr("; weak in 2 places"));
}

// Images whose names say nothing: a star about 2, and 4 and 0 have most in common.
TEST(Judge, ImagesInNoOrderAreJoinedByTheLinksOfMostPoints) {
  const ColmapModel model =
      ModelOfSights(NumberedNames(5), PlacesInARow(5),
                    {{{0, 2}, 60}, {{1, 2}, 70}, {{3, 2}, 80}, {{4, 2}, 90}, {{0, 4}, 200}, {{1, 3}, 10}});
  const Verdict verdict = JudgeModels({model});
  EXPECT_FALSE(verdict.is_drive);
  ASSERT_THAT(verdict.links, SizeIs(4));
  EXPECT_EQ(verdict.links[0].image1, 0);
  EXPECT_EQ(verdict.links[0].image2, 4);
  EXPECT_EQ(verdict.links[0].num_points, 200);
  EXPECT_DOUBLE_EQ(verdict.links[0].length, 4);
  EXPECT_EQ(verdict.links[1].num_points, 90);
  EXPECT_EQ(verdict.links[2].num_points, 80);
  EXPECT_EQ(verdict.links[3].num_points, 70);
  EXPECT_EQ(WholeText(verdict), "whole: all 5 images are joined");
  EXPECT_THAT(verdict.loops, IsEmpty());
}

// Of the 61 points that an image has in common with the next but one, the next must see 0.4 times as many.
TEST(Judge, ADriveIsWhereTheNextImageSeesMuchOfTheSame) {
  for (const int num_next : {24, 25}) {
    std::vector<ModelSight> sights = SightsOfNext(12, num_next);
    for (int i = 0; i + 2 < 12; ++i) sights.push_back({{i, i + 2}, 61});
    const Verdict verdict = JudgeModels({ModelOfSights(NumberedNames(12), PlacesInARow(12), sights)});
    EXPECT_EQ(verdict.is_drive, num_next == 25);
  }
}

TEST(Judge, FoldersAreWalksOfTheirOwnThatCommonPointsJoin) {
  std::vector<std::string> names = NumberedNames(6, "monday/");
  const std::vector<std::string> tuesday = NumberedNames(6, "tuesday/");
  names.insert(names.end(), tuesday.begin(), tuesday.end());
  std::vector<ModelSight> sights;
  for (const ModelSight& sight : SightsOfNext(12, 100)) {
    if (sight.images[0] != 5) sights.push_back(sight);
  }
  sights.push_back({{2, 8}, 40});
  std::vector<Eigen::Vector3d> places = PlacesInARow(12);
  for (int i = 6; i < 12; ++i) places[i].x() += 100;  // no step leads from the one to the other
  const Verdict verdict = JudgeModels({ModelOfSights(names, places, sights)}, {{"tuesday/9.jpg", "dark"}});
  EXPECT_TRUE(verdict.is_drive);
  EXPECT_THAT(verdict.links, SizeIs(10));
  EXPECT_DOUBLE_EQ(verdict.way, 10);
  ASSERT_THAT(verdict.walks, SizeIs(2));
  EXPECT_EQ(verdict.walks[0].folder, "monday");
  EXPECT_EQ(verdict.walks[1].num_images, 7);
  EXPECT_EQ(verdict.walks[1].num_joined, 6);
  EXPECT_EQ(verdict.walks[0].num_points_of_others, 40);
  EXPECT_EQ(WholeText(verdict), "not whole: 12 of 13 images are joined, 1 to no other; a way of 10.0 m")
      << "each holds the other";
  EXPECT_THAT(VerdictLines(verdict),
              testing::Contains("of folders: monday: 6 of 6 images, 40 points of "
                                "others, tuesday: 6 of 7 images, 40 points of others"));
}

// 24 images on Monday, of which Tuesday sees the first and the twelfth again: what is after that is free.
TEST(Judge, AnotherFoldersImagesHoldWhatTheySeeAgain) {
  std::vector<std::string> names = NumberedNames(24, "monday/");
  const std::vector<std::string> tuesday = NumberedNames(3, "tuesday/");
  names.insert(names.end(), tuesday.begin(), tuesday.end());
  std::vector<ModelSight> sights = SightsOfNext(24, 100);
  for (const ModelSight& more : {ModelSight{{24, 25}, 100}, ModelSight{{25, 26}, 100},
                                 ModelSight{{0, 24}, 50}, ModelSight{{11, 26}, 50}})
    sights.push_back(more);
  const Verdict verdict = JudgeModels({ModelOfSights(names, PlacesInARow(27), sights)});
  ASSERT_THAT(verdict.open_stretches, SizeIs(1));
  EXPECT_EQ(verdict.open_stretches[0].image1, 11);
  EXPECT_EQ(verdict.open_stretches[0].image2, 23);
  EXPECT_DOUBLE_EQ(verdict.open_stretches[0].length, 12);
}

TEST(Judge, PartsThatAreNotJoinedAreCountedOnce) {
  // COLMAP's models may have images in common.
  ColmapModel small = Drive(2), large = Drive(4), again = Drive(3);
  for (ModelImage& image : small.images) image.name = "b" + image.name;
  for (ModelImage& image : large.images) image.name = "c" + image.name;
  const Verdict verdict = JudgeModels({Drive(9), small, large, again, large}, {{"b0.jpg", ""},
                                                                               {"b1.jpg", ""},
                                                                               {"c0.jpg", ""},
                                                                               {"c1.jpg", ""},
                                                                               {"c2.jpg", ""},
                                                                               {"c3.jpg", ""},
                                                                               {"d.jpg", ""}});
  ASSERT_THAT(verdict.parts, SizeIs(2));
  EXPECT_EQ(verdict.parts[0].num_images, 4);
  EXPECT_EQ(verdict.parts[0].first, "c0.jpg");
  EXPECT_EQ(verdict.parts[0].last, "c3.jpg");
  EXPECT_EQ(verdict.parts[1].num_images, 2);
  EXPECT_THAT(WholeText(verdict),
              HasSubstr("9 of 16 images are joined, 6 in 2 separate parts, 1 to no other; a way"));
  EXPECT_THAT(VerdictLines(verdict), testing::Contains("not joined with the rest: 4 images (c0.jpg to "
                                                       "c3.jpg), 2 images (b0.jpg to b1.jpg)"));
}

TEST(Judge, ThreeImagesAreEnough) {
  const Verdict verdict = JudgeModels({Drive(3)});
  EXPECT_TRUE(verdict.is_drive);
  EXPECT_DOUBLE_EQ(verdict.way, 2);
  EXPECT_THAT(VerdictLines(verdict),
              testing::Contains("weakest between 0.jpg and 1.jpg, which 100 points join"));
  const Verdict one = JudgeModels({ModelOfSights({"only.jpg"}, {{0, 0, 0}}, {})}, {{"2.jpg", ""}});
  EXPECT_FALSE(one.is_drive);
  EXPECT_THAT(VerdictLines(one), Not(IsEmpty()));
}

TEST(SeenFromAbove, KeepsXAndYOfALevelWorld) {
  const auto places = SeenFromAbove({{0, 0, 1}, {10, 0, 1.1}, {10, 5, 1}, {0, 5, 0.9}});
  EXPECT_EQ(places[2], Eigen::Vector2d(10, 5));
  // A straight corridor is no upright plane, although heights differ more than what is across it.
  const auto corridor = SeenFromAbove({{0, 0, 1}, {10, 0.01, 1.2}, {20, 0, 0.9}, {30, 0, 1}});
  EXPECT_EQ(corridor[3], Eigen::Vector2d(30, 0));
}

// Images along a wall, one above the other: from above they would be a line.
TEST(SeenFromAbove, ShowsAnUprightPlaneFromItsSide) {
  const auto places = SeenFromAbove({{0, 0, 0}, {10, 0, 0}, {10, 0, 6}, {0, 0, 6}});
  EXPECT_NEAR((places[1] - places[0]).norm(), 10, 1e-9);
  EXPECT_NEAR((places[2] - places[1]).norm(), 6, 1e-9);
  EXPECT_NEAR(places[1].x() - places[0].x(), 10, 1e-9) << "its longer direction is x";
}

}  // namespace
}  // namespace cairn::reconstruct
