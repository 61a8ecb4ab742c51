#include "runtime/drive/place_belief.h"

#include <cmath>
#include <limits>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/localize/localization.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/map.h"
#include "tests/option_limits.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

using testing::ElementsAre;

constexpr int kNumImages = 12;

// A corridor: images 1 m apart that look along it (+x), each seeing ten landmarks 4 to 6 m ahead, half of
// which the next one sees too.  A view's radius is a tenth of 5 m.
MapRows Corridor() {
  MapRows rows;
  rows.name = "corridor";
  Camera camera;
  camera.width = camera.height = 100;
  camera.params = {100, 50, 50};
  rows.cameras = {camera};
  for (int i = 0; i < kNumImages; ++i) {
    MapImage image{.image_id = static_cast<ImageId>(i + 1),
                   .name = fmt::format("{:02}.jpg", i),
                   .camera_id = 1,
                   .cam_from_world = PoseAt({static_cast<double>(i), 0, 1}, 0)};
    for (int k = 0; k < 10; ++k) image.landmarks.push_back(5 * i + k);
    rows.images.push_back(std::move(image));
  }
  for (int k = 0; k < 5 * (kNumImages + 1); ++k)
    rows.landmarks.push_back({.position = {k / 5 + 4.5, 0.1 * (k % 5), 1}});
  rows.descriptors = DescriptorMatrix::Zero(5 * (kNumImages + 1), kSiftDescriptorDim);
  return rows;
}

Localization FixAt(double x_m, double probability = 0.999) {
  Localization found;
  found.reason = NoFix::kNone;
  found.cam_from_world = PoseAt({x_m, 0, 1}, 0);
  found.probability = probability;
  return found;
}

Localization NoFixBy(NoFix reason) {
  Localization found;
  found.reason = reason;
  return found;
}

Localization Ambiguous(double x_m, double other_x_m) {
  Localization found = NoFixBy(NoFix::kAmbiguous);
  found.probability = 0.999;
  found.possible_poses = {PoseAt({x_m, 0, 1}, 0), PoseAt({other_x_m, 0, 1}, 0)};
  found.possible_probabilities = {0.4995, 0.4995};
  return found;
}

PlaceBelief Make(const MapRows& rows = Corridor(), const PlaceBeliefOptions& options = {}) {
  return *PlaceBelief::Make(*Map::FromRows(rows), options);
}

double Sum(const PlaceBelief& belief) {
  return std::accumulate(belief.probabilities().begin(), belief.probabilities().end(), belief.elsewhere());
}

void See(PlaceBelief* belief, const Localization& found) {
  const Status status = belief->See(Query(), found);
  ASSERT_TRUE(status.ok()) << status.error().message;
  EXPECT_NEAR(Sum(*belief), 1, 1e-9);
}

PlaceHypothesis Leader(const PlaceBelief& belief) { return belief.Hypotheses(1)->front(); }

TEST(PlaceBelief, StartsAnywhere) {
  const PlaceBelief belief = Make();
  EXPECT_DOUBLE_EQ(belief.elsewhere(), 0.5);
  for (const double probability : belief.probabilities()) EXPECT_DOUBLE_EQ(probability, 0.5 / kNumImages);
}

TEST(PlaceBelief, ImagesOfTheSameLandmarksAreNeighbours) {
  const PlaceBelief belief = Make();
  EXPECT_THAT(belief.Neighbours(0), ElementsAre(1));
  EXPECT_THAT(belief.Neighbours(4), ElementsAre(3, 5));
  // Two of ten are not enough, a tenth of thirty is.
  MapRows rows = Corridor();
  rows.images[0].landmarks = {0, 1, 2, 3, 4, 10, 11};
  EXPECT_THAT(Make(rows).Neighbours(0), testing::IsEmpty());
  rows.images[0].landmarks = {0, 1, 2, 3, 10, 11, 12};
  EXPECT_THAT(Make(rows).Neighbours(0), ElementsAre(1, 2));
}

TEST(PlaceBelief, NoSingleImageMakesAPlaceCertain) {
  PlaceBelief belief = Make();
  See(&belief, FixAt(5));
  EXPECT_EQ(Leader(belief).image, 5);
  EXPECT_EQ(Leader(belief).image_id, 6u);
  EXPECT_EQ(Leader(belief).name, "05.jpg");
  EXPECT_GT(Leader(belief).probability, 0.95);
  EXPECT_LT(Leader(belief).probability, 0.995);
  See(&belief, FixAt(6));
  EXPECT_EQ(Leader(belief).image, 6);
  EXPECT_LT(belief.elsewhere(), 1e-3);
  EXPECT_GT(Leader(belief).probability, 0.99);
}

TEST(PlaceBelief, ARobotThatStandsStillLearnsLittleMore) {
  PlaceBelief still = Make(), moving = Make();
  const Localization weak = FixAt(5, 0.9);
  See(&still, weak);
  See(&moving, weak);
  EXPECT_EQ(still.elsewhere(), moving.elsewhere());
  See(&still, weak);
  See(&moving, FixAt(5.6, 0.9));
  EXPECT_GT(still.elsewhere(), 2 * moving.elsewhere());
}

TEST(PlaceBelief, AFixCountsByTheOddsThatItIsRight) {
  PlaceBelief likely = Make(), unlikely = Make(), certain = Make(), more_certain = Make();
  See(&likely, FixAt(5, 0.9));
  See(&unlikely, FixAt(5, 0.6));
  EXPECT_GT(Leader(likely).probability, Leader(unlikely).probability);
  EXPECT_LT(likely.elsewhere(), unlikely.elsewhere());
  // But no more than max_fix_odds.
  See(&certain, FixAt(5, 0.9999));
  See(&more_certain, FixAt(5, 1));
  EXPECT_EQ(certain.probabilities(), more_certain.probabilities());
}

TEST(PlaceBelief, ImagesWithoutAFixAreOfAnotherPlace) {
  PlaceBelief belief = Make();
  See(&belief, NoFixBy(NoFix::kTooFewMatches));
  EXPECT_GT(belief.elsewhere(), 0.8);
  const double before = belief.elsewhere();
  See(&belief, NoFixBy(NoFix::kNoPose));
  EXPECT_GT(belief.elsewhere(), before);
  // One without features shows nothing of any place: only that time has passed.
  PlaceBelief dark = Make();
  See(&dark, NoFixBy(NoFix::kTooFewFeatures));
  EXPECT_DOUBLE_EQ(dark.elsewhere(), 0.5);
  EXPECT_DOUBLE_EQ(dark.probabilities()[3], 0.5 / kNumImages);
}

TEST(PlaceBelief, OfTwoPlacesThatExplainAnImageBothArePossible) {
  PlaceBelief belief = Make();
  See(&belief, Ambiguous(2, 8));
  const auto places = *belief.Hypotheses(3);
  ASSERT_EQ(places.size(), size_t{3});
  EXPECT_NEAR(places[0].probability, places[1].probability, 0.02);
  EXPECT_THAT((std::vector<int32_t>{places[0].image, places[1].image}), testing::UnorderedElementsAre(2, 8));
  EXPECT_LT(belief.elsewhere(), 0.05);
  // Until one is seen that only one of them leads to.
  See(&belief, FixAt(9));
  EXPECT_EQ(Leader(belief).image, 9);
  EXPECT_GT(Leader(belief).probability, 0.98);
}

TEST(PlaceBelief, WithoutOdometryItReachesWhatImagesShareLandmarksWith) {
  PlaceBelief belief = Make(Corridor(), {.leave_ratio = 1e-6, .kidnapped_ratio = 1e-6});
  See(&belief, FixAt(5));
  See(&belief, FixAt(5.5));
  See(&belief, NoFixBy(NoFix::kTooFewFeatures));
  // Two links from there, and the fix was between 5 and 6.
  EXPECT_GT(belief.probabilities()[4], 0.02);
  EXPECT_GT(belief.probabilities()[7], 0.02);
  EXPECT_GT(belief.probabilities()[7], 100 * belief.probabilities()[10]);
}

TEST(PlaceBelief, OdometryMovesEveryHypothesis) {
  PlaceBelief belief = Make();
  See(&belief, Ambiguous(2, 7));
  ASSERT_TRUE(belief.Move({3, 0}, 0).ok());
  See(&belief, NoFixBy(NoFix::kTooFewFeatures));
  const auto& at = belief.probabilities();
  EXPECT_GT(at[5], 0.25);
  EXPECT_GT(at[10], 0.25);
  EXPECT_LT(at[2], 0.05);
  EXPECT_LT(at[7], 0.05);
}

// Half a metre is a view's radius.
TEST(PlaceBelief, TheWayToTheFirstImageMovesNothing) {
  PlaceBelief belief = Make(), other = Make();
  ASSERT_TRUE(belief.Move({3, 0}, RadFromDeg(90)).ok());
  for (PlaceBelief* each : {&belief, &other}) {
    See(each, FixAt(4));
    ASSERT_TRUE(each->Move({3, 0}, 0).ok());
    See(each, NoFixBy(NoFix::kTooFewFeatures));
  }
  EXPECT_EQ(belief.probabilities(), other.probabilities());
  EXPECT_EQ(Leader(belief).image, 7);
}

TEST(PlaceBelief, ShortWaysAddUp) {
  PlaceBelief belief = Make();
  See(&belief, FixAt(3));
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(belief.Move({0.15, 0}, 0).ok());
    See(&belief, NoFixBy(NoFix::kTooFewFeatures));
  }
  const auto& at = belief.probabilities();
  double mean = 0, sum = 0;
  for (int i = 0; i < kNumImages; ++i) {
    mean += i * at[i];
    sum += at[i];
  }
  EXPECT_NEAR(mean / sum, 6, 0.5);
  // To the left, after a quarter turn to the right, is ahead.
  PlaceBelief turned = Make();
  See(&turned, FixAt(3));
  ASSERT_TRUE(turned.Move({0, 0}, -RadFromDeg(90)).ok());
  ASSERT_TRUE(turned.Move({0, 3}, RadFromDeg(90)).ok());
  See(&turned, NoFixBy(NoFix::kTooFewFeatures));
  EXPECT_GT(turned.probabilities()[6], 0.5);
}

TEST(PlaceBelief, ToTheLeftIsToTheLeftOfWhereTheCameraLooks) {
  MapRows rows = Corridor();
  // The last two look along +y: 0.5 and 3.5 m to the left of the first.
  for (const auto& [image, y] : {std::pair(10, 0.5), std::pair(11, 3.5)})
    rows.images[image].cam_from_world = PoseAt({0, y, 1}, 90);
  PlaceBelief belief = Make(rows);
  See(&belief, FixAt(0));
  ASSERT_TRUE(belief.Move({0, 3.5}, RadFromDeg(90)).ok());
  See(&belief, NoFixBy(NoFix::kTooFewFeatures));
  EXPECT_GT(belief.probabilities()[11], 0.5);
  EXPECT_GT(belief.probabilities()[11], 10 * belief.probabilities()[10]);
}

TEST(PlaceBelief, ACarriedRobotIsFoundAgain) {
  PlaceBelief belief = Make();
  for (const double x : {1.0, 2.0, 3.0}) See(&belief, FixAt(x));
  EXPECT_GT(Leader(belief).probability, 0.99);
  See(&belief, FixAt(10));
  EXPECT_LT(Leader(belief).probability, 0.97);
  See(&belief, FixAt(10.9));
  EXPECT_EQ(Leader(belief).image, 11);
  EXPECT_GT(Leader(belief).probability, 0.97);
}

TEST(PlaceBelief, HypothesesShareNoImage) {
  PlaceBelief belief = Make();
  See(&belief, FixAt(5));
  const auto places = *belief.Hypotheses(100);
  double sum = 0;
  for (const PlaceHypothesis& place : places) sum += place.probability;
  EXPECT_NEAR(sum + belief.elsewhere(), 1, 1e-9);
  for (size_t i = 1; i < places.size(); ++i) EXPECT_GE(places[i - 1].probability, places[i].probability);
}

TEST(PlaceBelief, WhatTellsIsTheNearestImageWithoutALookAlike) {
  MapRows rows = Corridor();
  EXPECT_EQ(Make(rows).NextTellingImage(2), -1);  // the map does not know
  for (int32_t i = 0; i < kNumImages; ++i)
    rows.appearance.push_back({.images = {i}, .is_kept = true, .entropy = 0.5});
  for (int32_t i = 0; i < 5; ++i) rows.appearance[i].look_alikes = {{i + 6, 0.9}};  // 0 to 4 and 6 to 10
  EXPECT_EQ(Make(rows).NextTellingImage(2), 5);
  EXPECT_EQ(Make(rows).NextTellingImage(10), 11);
  EXPECT_EQ(Make(rows).NextTellingImage(5), 5);
}

TEST(PlaceBelief, ImagesAtAnyRateTellTheSame) {
  // The same way at the same speed, at 2 and at 20 images a second; each for itself, 20 would tell ten times
  // as much, in the exponent.
  PlaceBelief slow = Make(), fast = Make();
  for (int i = 0; i <= 60; ++i) {
    const double x_m = 2 + 0.05 * i;
    for (PlaceBelief* each : {&slow, &fast}) {
      const bool is_first = i == 0;
      if (each == &slow && i % 10 != 0) continue;
      ASSERT_TRUE(each->Elapse(is_first ? 0 : each == &slow ? 0.5 : 0.05).ok());
      See(each, FixAt(x_m, 0.7));
    }
  }
  EXPECT_NEAR(std::log10(fast.elsewhere()), std::log10(slow.elsewhere()), 0.5);
  // Nor do many images of nothing.
  PlaceBelief dark = Make(), dark_fast = Make();
  for (int i = 0; i < 3; ++i) See(&dark, NoFixBy(NoFix::kNoPose));
  for (int i = 0; i < 60; ++i) {
    ASSERT_TRUE(dark_fast.Elapse(0.05).ok());
    See(&dark_fast, NoFixBy(NoFix::kNoPose));
  }
  EXPECT_NEAR(std::log10(1 - dark_fast.elsewhere()), std::log10(1 - dark.elsewhere()), 0.4);
}

TEST(PlaceBelief, NoSingleViewMakesAPlaceCertainInHoweverManyImages) {
  PlaceBelief belief = Make();
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(belief.Elapse(0.05).ok());
    See(&belief, FixAt(5 + 0.001 * i));
  }
  EXPECT_LT(Leader(belief).probability, 0.995);
}

TEST(PlaceBelief, FixesThatJitterTellNoMoreThanOneThatStays) {
  PlaceBelief still = Make(), jitters = Make();
  for (int i = 0; i < 40; ++i) {
    for (PlaceBelief* each : {&still, &jitters}) ASSERT_TRUE(each->Elapse(0.05).ok());
    See(&still, FixAt(5, 0.7));
    See(&jitters, FixAt(5 + (i % 2 == 0 ? 0.05 : 0), 0.7));
  }
  // A tenth of a view's radius is told once.
  EXPECT_NEAR(std::log10(jitters.elsewhere()), std::log10(still.elsewhere()), 0.1);
}

TEST(PlaceBelief, TheSamePlacesInAnotherOrderAreNoNewView) {
  PlaceBelief same = Make(), flips = Make();
  for (int i = 0; i < 20; ++i) {
    for (PlaceBelief* each : {&same, &flips}) ASSERT_TRUE(each->Elapse(0.05).ok());
    See(&same, Ambiguous(2, 8));
    See(&flips, i % 2 == 0 ? Ambiguous(2, 8) : Ambiguous(8, 2));
  }
  EXPECT_NEAR(std::log10(flips.elsewhere()), std::log10(same.elsewhere()), 1e-6);
}

TEST(PlaceBelief, WhileNothingIsSeenItForgetsByTheTime) {
  PlaceBelief soon = Make(), late = Make();
  for (PlaceBelief* each : {&soon, &late}) {
    for (const double x : {4.0, 5.0, 6.0}) See(each, FixAt(x));
  }
  ASSERT_TRUE(soon.Elapse(0.1).ok());
  ASSERT_TRUE(late.Elapse(60).ok());
  for (PlaceBelief* each : {&soon, &late}) See(each, NoFixBy(NoFix::kTooFewFeatures));
  EXPECT_GT(Leader(soon).probability, 0.98);
  EXPECT_LT(Leader(late).probability, 0.5);
  EXPECT_GT(late.elsewhere(), 0.1);
}

TEST(PlaceBelief, GravityRefutesAndConfirmsNothing) {
  PlaceBelief told = Make(), not_told = Make(), tilted = Make();
  const Eigen::Vector3d up(0, -2, 0);  // of a level camera; of any length
  ASSERT_TRUE(told.SenseUp(up, 1).ok());
  See(&told, FixAt(5));
  See(&not_told, FixAt(5));
  EXPECT_NEAR(Leader(told).probability, Leader(not_told).probability, 1e-9);
  // 20 degrees of roll are nine standard deviations of hypot(1, 2) degrees.
  ASSERT_TRUE(tilted.SenseUp({std::sin(RadFromDeg(20)), -std::cos(RadFromDeg(20)), 0}, 1).ok());
  See(&tilted, FixAt(5));
  EXPECT_LT(Leader(tilted).probability, 0.2);
  EXPECT_GT(tilted.elsewhere(), 0.4);
  // It was of that image alone.
  See(&tilted, FixAt(6));
  EXPECT_EQ(Leader(tilted).image, 6);
  EXPECT_GT(Leader(tilted).probability, 0.9);
}

TEST(PlaceBelief, AFixMayBeOfAKnownLookAlike) {
  MapRows rows = Corridor();
  for (int32_t i = 0; i < kNumImages; ++i)
    rows.appearance.push_back({.images = {i}, .is_kept = true, .entropy = 0.5});
  rows.appearance[2].look_alikes = {{8, 0.9}};
  PlaceBelief belief = Make(rows);
  See(&belief, FixAt(2));
  EXPECT_EQ(Leader(belief).image, 2);
  // look_alike_fix_ratio / fix_ratio of one image against the share of three.
  EXPECT_GT(belief.probabilities()[8], 5 * belief.probabilities()[10]);
  PlaceBelief other = Make();
  See(&other, FixAt(2));
  EXPECT_DOUBLE_EQ(other.probabilities()[8], other.probabilities()[10]);
}

TEST(PlaceBelief, OfPossiblePosesOneThatIsHopelessCountsLess) {
  Localization found = Ambiguous(2, 8);
  found.possible_probabilities = {0.9, 0.0999};  // alike within max_fix_odds
  PlaceBelief alike = Make();
  See(&alike, found);
  EXPECT_NEAR(alike.Hypotheses(2)->at(1).probability, alike.Hypotheses(2)->at(0).probability, 0.02);
  found.possible_probabilities = {0.9989, 1e-5};
  PlaceBelief hopeless = Make();
  See(&hopeless, found);
  EXPECT_EQ(Leader(hopeless).image, 2);
  EXPECT_GT(Leader(hopeless).probability, 0.8);
}

TEST(PlaceBelief, WhatIsAroundAPoseIsItsProbability) {
  PlaceBelief belief = Make();
  See(&belief, FixAt(5));
  EXPECT_NEAR(belief.ProbabilityAround(PoseAt({5, 0, 1}, 0)), Leader(belief).probability, 0.02);
  EXPECT_LT(belief.ProbabilityAround(PoseAt({10, 0, 1}, 0)), 0.02);
}

TEST(PlaceBelief, RefusesWhatItCannotUse) {
  PlaceBelief belief = Make();
  EXPECT_EQ(belief.Move({std::numeric_limits<double>::quiet_NaN(), 0}, 0).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(belief.Move({0, 0}, std::numeric_limits<double>::infinity()).error().code,
            ErrorCode::kInvalidArgument);
  for (const double seconds : {-0.1, std::numeric_limits<double>::infinity(), std::nan("")})
    EXPECT_EQ(belief.Elapse(seconds).error().code, ErrorCode::kInvalidArgument);
  for (const auto& [up, sigma_deg] :
       {std::pair(Eigen::Vector3d(0, 0, 0), 1.0), std::pair(Eigen::Vector3d(0, std::nan(""), 1), 1.0),
        std::pair(Eigen::Vector3d(0, -1, 0), 0.0), std::pair(Eigen::Vector3d(0, -1, 0), std::nan(""))})
    EXPECT_EQ(belief.SenseUp(up, sigma_deg).error().code, ErrorCode::kInvalidArgument);
  Localization without_probabilities = Ambiguous(2, 8);
  without_probabilities.possible_probabilities.clear();
  EXPECT_EQ(belief.See(Query(), without_probabilities).error().code, ErrorCode::kInvalidArgument);
  MapRows unscaled = Corridor();
  unscaled.frame.unit = "arbitrary";
  EXPECT_EQ(Make(unscaled).Move({1, 0}, 0).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(PlaceBelief::Make(*Map::FromRows(Corridor()), {.fix_ratio = 2}).error().code,
            ErrorCode::kInvalidArgument);
  MapRows empty;
  empty.name = "empty";
  EXPECT_EQ(PlaceBelief::Make(*Map::FromRows(empty)).error().code, ErrorCode::kNoData);
}

TEST(PlaceBelief, OptionsHaveTheirRanges) {
  ExpectLimits<PlaceBeliefOptions>({{"fix_ratio", "1e-9", "9e-10", "0.89", "0.891"},
                                    {"wrong_fix_ratio", "1e-9", "9e-10", "0.009", "0.0091"},
                                    {"look_alike_fix_ratio", "1e-9", "9e-10", "0.1", "0.101"},
                                    {"foreign_fix_ratio", "1e-9", "9e-10", "0.999999999", "0.9999999995"},
                                    {"max_fix_odds", "1", "0.999"},
                                    {"misled_ratio", "1e-9", "9e-10", "0.999999999", "0.9999999995"},
                                    {"least_new_ratio", "1e-9", "9e-10", "1", "1.001"},
                                    {"likeness_weight", "0", "-0.001"},
                                    {"elsewhere_ratio", "1e-9", "9e-10", "0.999999999", "0.9999999995"},
                                    {"leave_ratio", "1e-9", "9e-10", "0.999999999", "0.9999999995"},
                                    {"return_ratio", "1e-9", "9e-10", "0.999999999", "0.9999999995"},
                                    {"kidnapped_ratio", "1e-9", "9e-10", "0.999999999", "0.9999999995"},
                                    {"reach_links", "1", "0.999", "100", "100.1"},
                                    {"way_sigma_ratio", "0", "-0.001"},
                                    {"turn_sigma_ratio", "0", "-0.001"},
                                    {"way_sigma_m", "1e-9", "9e-10"},
                                    {"turn_sigma_deg", "1e-9", "9e-10"},
                                    {"map_up_sigma_deg", "1e-9", "9e-10", "90", "90.001"}});
}

}  // namespace
}  // namespace cairn
