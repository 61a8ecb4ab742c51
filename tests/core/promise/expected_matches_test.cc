#include "core/promise/expected_matches.h"

#include <cmath>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/promise/wall_survey.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

double MeanProbability(const ExpectedMatches& matches, size_t first, size_t step) {
  double sum = 0;
  int num = 0;
  for (size_t i = first; i < matches.of_class.size(); i += step) {
    for (const ExpectedMatch& match : matches.of_class[i]) sum += match.probability, ++num;
  }
  return sum / num;
}

// Nobody can know more of a class that every image sees with probability 1/2 than that.
TEST(LearnMatches, LearnsHowOftenClassesAreSeenAgain) {
  const Classes classes = RandomWallSurvey(24, 0.25, 600, 0.5, 0.5, 3);
  const ExpectedMatches matches = LearnMatches(classes, {}, 2);
  EXPECT_GT(matches.num_learnt_from, 2000);
  EXPECT_THAT(matches.of_class, SizeIs(classes.classes.size()));
  EXPECT_NEAR(MeanProbability(matches, 0, 1), 0.5, 0.06);
}

TEST(LearnMatches, ClassesThatImagesMissAreExpectedLessOften) {
  Classes classes = RandomWallSurvey(24, 0.25, 600, 0.9, 0.3, 4);
  // Classes in the order of their places, whether they are good or bad.
  std::vector<FeatureClass> good, bad;
  for (const FeatureClass& row : classes.classes) {
    int num_looking = 0;
    for (int image = 0; image < 24; ++image) num_looking += std::abs(row.position.x() - 0.25 * image) < 2;
    (static_cast<double>(row.observations.size()) > 0.6 * num_looking ? good : bad).push_back(row);
  }
  const size_t num_good = good.size();
  classes.classes = good;
  classes.classes.insert(classes.classes.end(), bad.begin(), bad.end());
  const ExpectedMatches matches = LearnMatches(classes, {}, 2);
  double sums[2] = {0, 0};
  int nums[2] = {0, 0};
  for (size_t i = 0; i < matches.of_class.size(); ++i) {
    for (const ExpectedMatch& match : matches.of_class[i])
      sums[i >= num_good] += match.probability, ++nums[i >= num_good];
  }
  EXPECT_GT(sums[0] / nums[0], 0.8);
  EXPECT_LT(sums[1] / nums[1], 0.45);
}

TEST(LearnMatches, ViewsLieApartAndEveryImageIsNearOne) {
  const Classes classes = RandomWallSurvey(40, 0.03, 200, 0.8, 0.8, 5);
  const ExpectedMatches matches = LearnMatches(classes, {}, 1);
  const ViewDistance distance(classes, {});
  EXPECT_GT(matches.views.size(), 5U);
  EXPECT_LT(matches.views.size(), 20U);
  for (size_t image = 0; image < classes.images.size(); ++image) {
    double nearest = 1e9;
    for (const int32_t view : matches.views) nearest = std::min(nearest, distance(image, view));
    EXPECT_LT(nearest, 0.5);
  }
  for (size_t a = 0; a < matches.views.size(); ++a) {
    for (size_t b = 0; b < a; ++b) EXPECT_GE(distance(matches.views[a], matches.views[b]), 0.5);
  }
  EXPECT_NEAR(matches.depth, distance.depth(), 0);
}

// A camera that looks away, one that does not exist and one too far away see nothing.
TEST(LearnMatches, OnlyImagesThatLookAtAClassExpectIt) {
  Classes classes = RandomWallSurvey(20, 0.25, 400, 0.8, 0.8, 6);
  const Eigen::Quaterniond back(Eigen::AngleAxisd(RadFromDeg(180), Eigen::Vector3d::UnitY()));
  for (SurveyImage& image : classes.images) {
    if (image.image_id <= 3) image.cam_from_world = Pose{back, {}} * image.cam_from_world;
    if (image.image_id == 4) image.camera_id = 9;
  }
  for (FeatureClass& row : classes.classes)
    std::erase_if(row.observations, [](const Observation& observation) { return observation.image_id <= 4; });
  std::erase_if(classes.classes, [](const FeatureClass& row) { return row.observations.size() < 2; });
  const ExpectedMatches matches = LearnMatches(classes, {}, 2);
  for (size_t i = 0; i < matches.of_class.size(); ++i) {
    for (const ExpectedMatch& match : matches.of_class[i]) {
      const int image = matches.views[match.view];
      EXPECT_GE(image, 4);
      const double x = classes.classes[i].position.x() - 0.25 * image;
      EXPECT_LE(std::abs(x), 2 + 1e-9);  // half of 400 px at 2 m, f = 200 px
    }
  }
}

// Two sessions of the same places take turns.  The first sees half of the classes well and of the others this
// part, the second the other way round: another light shows other things.
Classes SurveyInTwoLights(double first_sees_others, double second_sees_others, uint64_t seed) {
  Classes classes = WallSurvey(48, 0.125);
  classes.sessions = {"noon", "night"};
  for (size_t i = 0; i < classes.images.size(); ++i)
    classes.images[i].name = classes.sessions[i % 2] + "/" + std::to_string(i);
  Random random(seed);
  for (int n = 0; n < 600; ++n) {
    const double x = 6 * random.Uniform();
    std::vector<ImageId> seen_by;
    for (int image = 0; image < 48; ++image) {
      const double of_others = image % 2 == 0 ? first_sees_others : second_sees_others;
      if (std::abs(x - 0.125 * image) < 2 && random.Uniform() < (image % 2 == n % 2 ? 0.8 : of_others))
        seen_by.push_back(static_cast<ImageId>(image + 1));
    }
    AddClass({x, 2 * random.Uniform() - 1, 2}, seen_by, 3, &classes);
  }
  return classes;
}

TEST(LearnMatches, WhatOneLightShowsIsHardlyExpectedInAnother) {
  const Classes classes = SurveyInTwoLights(0.1, 0.1, 8);
  const ExpectedMatches matches = LearnMatches(classes, {}, 2);
  double sums[2] = {0, 0};
  int nums[2] = {0, 0};
  for (size_t i = 0; i < matches.of_class.size(); ++i) {
    for (const ExpectedMatch& match : matches.of_class[i]) {
      const bool is_own = matches.views[match.view] % 2 == static_cast<int>(i % 2);
      sums[is_own] += match.probability;
      ++nums[is_own];
    }
  }
  ASSERT_GT(nums[0], 1000);
  EXPECT_GT(sums[1] / nums[1], 0.7);
  EXPECT_LT(sums[0] / nums[0], 0.25);
  // An image that is taken in a light expects what that shows.
  const MatchModel model(classes, {}, 1);
  double expected[2][2] = {{0, 0}, {0, 0}};
  for (const int session : {0, 1}) {
    const auto of_looks = model.At({{&classes.cameras[0], classes.images[24].cam_from_world, session}},
                                   MatchModel::Where::kNearby, 1);
    for (const ClassMatch& match : of_looks[0]) expected[session][match.i % 2] += match.probability;
  }
  EXPECT_GT(expected[0][0], 3 * expected[0][1]);
  EXPECT_GT(expected[1][1], 3 * expected[1][0]);
}

// The second session is the first to see classes that are new: that the first does not see them says nothing.
TEST(LearnMatches, WhatWasNotThereYetIsExpectedAllTheSame) {
  Classes classes = SurveyInTwoLights(0, 0.5, 9);
  const auto mean_at_night = [&] {
    const ExpectedMatches matches = LearnMatches(classes, {}, 2);
    double sum = 0;
    int num = 0;
    for (size_t i = 1; i < matches.of_class.size(); i += 2) {
      for (const ExpectedMatch& match : matches.of_class[i]) {
        if (matches.views[match.view] % 2 == 1) sum += match.probability, ++num;
      }
    }
    return sum / num;
  };
  const double as_if_there = mean_at_night();
  for (size_t i = 0; i < classes.classes.size(); ++i)
    classes.classes[i].age.sessions = {{.there = i % 2 == 1 ? 0.0F : 1.0F}, {.there = 1}};
  EXPECT_GT(mean_at_night(), as_if_there + 0.01);
  EXPECT_NEAR(mean_at_night(), 0.8, 0.05);
}

TEST(LearnMatches, WhatIsPerhapsGoneIsExpectedAsMuchLess) {
  Classes classes = RandomWallSurvey(24, 0.25, 300, 0.5, 0.5, 3);
  const Camera& camera = classes.cameras[0];
  const auto expected = [&] {
    const MatchModel model(classes, {}, 1);
    const auto of_image =
        model.At({{&camera, classes.images[12].cam_from_world, -1}}, MatchModel::Where::kThere, 1)[0];
    return std::pair(model.OfViews(1).of_class[7].at(0).probability, of_image.at(5).probability);
  };
  const auto certain = expected();
  for (FeatureClass& row : classes.classes) row.age.presence = 0.5F;
  const auto perhaps = expected();
  EXPECT_FLOAT_EQ(perhaps.first, certain.first / 2);
  EXPECT_FLOAT_EQ(perhaps.second, certain.second / 2);
}

TEST(LearnMatches, SameForAnyNumberOfThreads) {
  const Classes classes = RandomWallSurvey(20, 0.25, 300, 0.8, 0.4, 7);
  const ExpectedMatches one = LearnMatches(classes, {}, 1), three = LearnMatches(classes, {}, 3);
  EXPECT_EQ(one.weights, three.weights);
  ASSERT_EQ(one.of_class.size(), three.of_class.size());
  for (size_t i = 0; i < one.of_class.size(); ++i) {
    ASSERT_EQ(one.of_class[i].size(), three.of_class[i].size());
    for (size_t j = 0; j < one.of_class[i].size(); ++j) {
      EXPECT_EQ(one.of_class[i][j].view, three.of_class[i][j].view);
      EXPECT_EQ(one.of_class[i][j].probability, three.of_class[i][j].probability);
    }
  }
}

TEST(LearnMatches, SurveysWithoutAnythingToLearnFromExpectNothingImpossible) {
  EXPECT_THAT(LearnMatches({}, {}, 1).of_class, IsEmpty());
  Classes classes = WallSurvey(2, 0.5);
  EXPECT_THAT(LearnMatches(classes, {}, 1).views, ElementsAre(0, 1));
  AddClass({0.2, 0, 2}, {1, 2}, 3, &classes);
  AddClass({0.2, 0, 2}, {}, 3, &classes);
  const ExpectedMatches matches = LearnMatches(classes, {}, 1);
  ASSERT_THAT(matches.of_class[0], SizeIs(2));
  for (const ExpectedMatch& match : matches.of_class[0]) {
    EXPECT_GT(match.probability, 0);
    EXPECT_LT(match.probability, 1);
  }
  EXPECT_THAT(matches.of_class[1], IsEmpty());
}

}  // namespace
}  // namespace cairn
