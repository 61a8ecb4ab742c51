#include "runtime/belief/pose_belief.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "core/base/random.h"
#include "core/geometry/pose.h"

namespace cairn {
namespace {

constexpr double kAreaM2 = 100;
constexpr double kAnywhere = kAreaM2 * 2 * std::numbers::pi;

PossiblePlace Place(double x, double y, double heading_rad, double probability, double sigma = 0.1) {
  PossiblePlace place;
  place.pose = {{x, y}, heading_rad};
  place.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  place.probability = probability;
  return place;
}

double Density(double squared, double sigma) {
  return std::exp(-0.5 * squared) / std::pow(sigma * std::sqrt(2 * std::numbers::pi), 3);
}

double Sum(const PoseBelief& belief) {
  double sum = belief.elsewhere();
  for (const PossiblePlace& place : belief.places()) sum += place.probability;
  return sum;
}

// What a belief says of the places near to one.
double Near(const PoseBelief& belief, double x, double y) {
  double sum = 0;
  for (const PossiblePlace& place : belief.places())
    sum += (place.pose.position - Eigen::Vector2d(x, y)).norm() < 0.5 ? place.probability : 0;
  return sum;
}

TEST(PoseBelief, TheFirstLookIsBelievedAsFarAsLooksAre) {
  PoseBelief belief(kAreaM2, {.surprise_ratio = 0.1});
  EXPECT_EQ(belief.elsewhere(), 1);
  EXPECT_TRUE(belief.places().empty());
  belief.Update(std::vector{Place(5, 5, 1, 0.2), Place(1, 2, 3, 0.6, 0.3)});
  ASSERT_EQ(belief.places().size(), 2u);
  const PossiblePlace& first = belief.places()[0];
  EXPECT_EQ(first.pose.position, Eigen::Vector2d(1, 2));
  EXPECT_EQ(first.pose.heading_rad, 3);
  EXPECT_TRUE(first.covariance.isApprox(0.09 * Eigen::Matrix3d::Identity()));
  EXPECT_NEAR(first.probability, 0.9 * 0.6, 1e-12);
  EXPECT_NEAR(belief.places()[1].probability, 0.9 * 0.2, 1e-12);
  EXPECT_NEAR(belief.elsewhere(), 1 - 0.9 * 0.8, 1e-12);
}

// Bayes' rule, by hand.
TEST(PoseBelief, TwoLooksAtOnePlaceAreOne) {
  const PoseBeliefOptions options{.surprise_ratio = 0.1, .lost_ratio = 0.01};
  PoseBelief belief(kAreaM2, options);
  belief.Update(std::vector{Place(1, 2, 0, 1, 0.1)});
  PossiblePlace second = Place(1.2, 2, 0.1, 1, 0.2);
  belief.Update(std::vector{second});
  ASSERT_EQ(belief.places().size(), 1u);
  const double before = 0.9 * 0.99, elsewhere = 1 - before;
  const double sigma = std::hypot(0.1, 0.2), squared = (0.04 + 0.01) / 0.05;
  // Moves may have slipped: their errors are three times as large in a twentieth of cases.
  const double wide = std::hypot(0.3, 0.2), wide_squared = (0.04 + 0.01) / 0.13;
  const double agrees = before * kAnywhere * 0.95 * Density(squared, sigma),
               slipped = before * kAnywhere * 0.05 * Density(wide_squared, wide);
  const double seen = 0.9 * (elsewhere + agrees + slipped);
  const double sum = seen + 0.1 * before + 0.1 * elsewhere;
  const PossiblePlace& place = belief.places()[0];
  EXPECT_NEAR(place.probability, (seen + 0.1 * before) / sum, 1e-9);
  EXPECT_NEAR(belief.elsewhere(), 0.1 * elsewhere / sum, 1e-9);
  // Both together, each by how exact it is.
  EXPECT_NEAR(place.pose.position.x(), 1 + 0.2 * 0.01 / 0.05, 1e-12);
  EXPECT_NEAR(place.pose.position.y(), 2, 1e-12);
  EXPECT_NEAR(place.pose.heading_rad, 0.1 * 0.01 / 0.05, 1e-12);
  EXPECT_TRUE(place.covariance.isApprox(0.01 * 0.04 / 0.05 * Eigen::Matrix3d::Identity()));
}

// A corridor's middle, of which a look knows only that it is there, and two places in it: both stay, as exact
// as they were.
TEST(PoseBelief, PlacesInOneRowStayApart) {
  PoseBelief belief(kAreaM2);
  belief.Update(std::vector{Place(2, 5, 0, 0.5), Place(6, 5, 0, 0.4)});
  PossiblePlace row = Place(5, 5, 0, 1);
  row.covariance(0, 0) = 9;
  belief.Update(std::vector{row});
  EXPECT_GT(Near(belief, 2, 5) + Near(belief, 6, 5), 0.97);
  EXPECT_NEAR(Near(belief, 2, 5) / Near(belief, 6, 5), 0.5 / 0.4 * std::exp(-0.5 * (9 - 1) / 9.02), 0.02);
  EXPECT_NEAR(belief.places()[0].pose.position.x(), 6, 0.01);
  EXPECT_NEAR(belief.places()[0].covariance(0, 0), 0.01, 1e-4);
}

TEST(PoseBelief, WaysTellTwinsApart) {
  PoseBelief belief(kAreaM2);
  belief.Update(std::vector{Place(1, 1, 0, 0.5), Place(6, 6, 0, 0.5)});
  EXPECT_NEAR(belief.places()[0].probability, belief.places()[1].probability, 1e-12);
  UncertainPlanarPose step;
  step.pose = {{2, 0}, 0};
  step.covariance = 0.01 * Eigen::Matrix3d::Identity();
  belief.Move(step);
  // Two metres on there is a twin of another place.
  belief.Update(std::vector{Place(3, 1, 0, 0.5), Place(9, 2, 0, 0.5)});
  EXPECT_GT(Near(belief, 3, 1), 0.97);
  EXPECT_NEAR(Sum(belief), 1, 1e-12);
  EXPECT_LT(Near(belief, 9, 2), 0.01);
}

TEST(PoseBelief, MovesAddTheirErrors) {
  Random random(3);
  PoseBelief belief(kAreaM2);
  PossiblePlace start = Place(2, 3, 3, 1);
  start.covariance << 0.04, 0.01, 0.005, 0.01, 0.02, -0.002, 0.005, -0.002, 0.01;
  belief.Update(std::vector{start});
  UncertainPlanarPose step;
  step.pose = {{1.5, 0.5}, 0.4};
  step.covariance << 0.02, 0.003, 0, 0.003, 0.01, 0.002, 0, 0.002, 0.004;
  belief.Move(step);
  const Eigen::Matrix3d root = start.covariance.llt().matrixL(), step_root = step.covariance.llt().matrixL();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  constexpr int kNum = 200000;
  constexpr double kSmall = 0.05;  // errors so small that motion is linear in them
  const auto normal = [&] {
    return Eigen::Vector3d(random.Normal(0, kSmall), random.Normal(0, kSmall), random.Normal(0, kSmall));
  };
  for (int i = 0; i < kNum; ++i) {
    const Eigen::Vector3d a = root * normal(), b = step_root * normal();
    const PlanarPose from{start.pose.position + a.head<2>(), start.pose.heading_rad + a[2]};
    Eigen::Vector3d off;
    off << from.FloorFromRobot(step.pose.position + b.head<2>()) - belief.places()[0].pose.position,
        WrapAngle(from.heading_rad + step.pose.heading_rad + b[2] - belief.places()[0].pose.heading_rad);
    mean += off / kNum;
    second += off * off.transpose() / kNum;
  }
  EXPECT_LT(mean.norm(), 5e-4);
  EXPECT_TRUE((second / (kSmall * kSmall)).isApprox(belief.places()[0].covariance, 0.01));
  EXPECT_LE(belief.places()[0].pose.heading_rad, std::numbers::pi);
}

// What one look says may be wrong: its place and the one before are both kept, until the next tells.
TEST(PoseBelief, ASurpriseKeepsWhatWasBelieved) {
  PoseBelief belief(kAreaM2, {.surprise_ratio = 0.1, .lost_ratio = 0.01});
  belief.Update(std::vector{Place(1, 1, 0, 1)});
  belief.Update(std::vector{Place(8, 8, 1, 1)});
  ASSERT_EQ(belief.places().size(), 2u);
  const double before = 0.9 * 0.99, elsewhere = 1 - before;
  const double sum = 0.9 * elsewhere + 0.1;
  EXPECT_NEAR(Near(belief, 8, 8), 0.9 * elsewhere / sum, 1e-9);
  EXPECT_NEAR(Near(belief, 1, 1), 0.1 * before / sum, 1e-9);
  EXPECT_EQ(belief.places()[0].pose.position, Eigen::Vector2d(8, 8));
  PoseBelief back = belief;
  back.Update(std::vector{Place(1, 1, 0, 1)});
  EXPECT_GT(Near(back, 1, 1), 0.99);
  belief.Update(std::vector{Place(8, 8, 1, 1)});  // it was carried there
  EXPECT_GT(Near(belief, 8, 8), 0.99);
}

TEST(PoseBelief, HeadingsMeetAtHalfATurn) {
  PoseBelief belief(kAreaM2);
  belief.Update(std::vector{Place(1, 1, 3.1, 1)});
  belief.Update(std::vector{Place(1, 1, -3.1, 1)});
  ASSERT_EQ(belief.places().size(), 1u);
  EXPECT_GT(std::abs(belief.places()[0].pose.heading_rad), 3.1);
}

TEST(PoseBelief, ALookThatSaysNothingLeavesTheWeights) {
  PoseBelief belief(kAreaM2, {.lost_ratio = 0.01});
  belief.Update(std::vector{Place(1, 1, 0, 0.8)});
  const double before = belief.places()[0].probability;
  belief.Update({});
  EXPECT_NEAR(belief.places()[0].probability, 0.99 * before, 1e-12);
  EXPECT_NEAR(Sum(belief), 1, 1e-12);
}

TEST(PoseBelief, ManyPlacesAreTheMostProbableOnes) {
  PoseBelief belief(kAreaM2, {.least_probability = 0.01, .max_num_places = 3});
  std::vector<PossiblePlace> seen;
  for (int i = 0; i < 5; ++i) seen.push_back(Place(i, 0, 0, 0.1 + 0.02 * i));
  belief.Update(seen);
  ASSERT_EQ(belief.places().size(), 3u);
  EXPECT_EQ(belief.places()[0].pose.position.x(), 4);
  EXPECT_EQ(belief.places()[2].pose.position.x(), 2);
  EXPECT_NEAR(Sum(belief), 1, 1e-12);
  PoseBelief few(kAreaM2, {.least_probability = 0.01});
  few.Update(std::vector{Place(1, 0, 0, 0.98), Place(5, 0, 0, 0.011), Place(8, 0, 0, 0.009)});
  EXPECT_EQ(few.places().size(), 2u);
}

TEST(PoseBelief, WhatIsNoLookDoesNoHarm) {
  PoseBelief belief(kAreaM2);
  belief.Update(std::vector{Place(1, 1, 0, 0.9)});
  PossiblePlace no_covariance = Place(1, 1, 0, 0.5);
  no_covariance.covariance(1, 1) = NAN;
  belief.Update(std::vector{Place(NAN, 1, 0, 0.5), Place(1, 1, INFINITY, 0.5), Place(1, 1, 0, NAN),
                            Place(1, 1, 0, -1), no_covariance});
  ASSERT_EQ(belief.places().size(), 1u);
  EXPECT_NEAR(Sum(belief), 1, 1e-12);
  belief.Update(std::vector{Place(1, 1, 0, 3), Place(5, 5, 0, 1)});  // more than 1 in all: three to one
  EXPECT_NEAR(Sum(belief), 1, 1e-12);
  EXPECT_GE(belief.elsewhere(), 0);
  PoseBelief fresh(kAreaM2, {.surprise_ratio = 0.1});
  fresh.Update(std::vector{Place(1, 1, 0, 3), Place(5, 5, 0, 1)});
  EXPECT_NEAR(fresh.places()[0].probability, 0.9 * 0.75, 1e-12);
}

TEST(PoseBelief, CorrectionsMovePlacesAndKeepTheirWeights) {
  PoseBelief belief(kAreaM2);
  belief.Update(std::vector{Place(1, 1, 0, 0.6), Place(5, 5, 0, 0.3)});
  const double first = belief.places()[0].probability, second = belief.places()[1].probability;
  // 0.2 m from the first, with the same error; a worse one as near; one that is far from all.
  belief.Correct(std::vector{Place(1.2, 1, 0, 0.01), Place(0.8, 1, 0, 0.001), Place(5, 6, 0, 0.99)});
  EXPECT_NEAR(belief.places()[0].pose.position.x(), 1.1, 1e-12);
  EXPECT_NEAR(belief.places()[0].covariance(0, 0), 0.01, 1e-12);
  EXPECT_EQ(belief.places()[0].probability, first);
  EXPECT_EQ(belief.places()[1].pose.position, Eigen::Vector2d(5, 5));
  EXPECT_EQ(belief.places()[1].probability, second);
}

// A look that speaks against a place still says where in it the robot is; how exactly it does not.
TEST(PoseBelief, ADoubtedPlaceIsMovedButNoSurer) {
  PoseBelief belief(kAreaM2);
  belief.Update(std::vector{Place(1, 1, 0, 1, 0.2)});
  belief.Update(std::vector{Place(1.4, 1, 0, 1e-12, 0.1), Place(8, 8, 0, 1)});
  const auto at = std::find_if(belief.places().begin(), belief.places().end(),
                               [](const PossiblePlace& place) { return place.pose.position.x() < 2; });
  ASSERT_NE(at, belief.places().end());
  EXPECT_NEAR(at->pose.position.x(), 1 + 0.4 * 0.04 / 0.05, 1e-6);
  EXPECT_NEAR(at->covariance(0, 0), 0.04, 1e-6);
}

// By hand: within two standard deviations of the better one, to which a little is added.
TEST(PoseBelief, PlacesAreOneWithinTwoDeviationsOfTheBetter) {
  const auto num_places = [](double apart_m, double turned_rad, double sigma) {
    PoseBelief belief(kAreaM2);
    // The other one's errors do not count.
    belief.Update(std::vector{Place(1, 1, 0, 0.5, sigma), Place(1 + apart_m, 1, turned_rad, 0.4, 1)});
    return belief.places().size();
  };
  // Of places that are known exactly it is the little alone: 0.1 m, 3 degrees.
  EXPECT_EQ(num_places(0.098, 0, 1e-4), 1u);
  EXPECT_EQ(num_places(0.102, 0, 1e-4), 2u);
  EXPECT_EQ(num_places(0, RadFromDeg(2.99), 1e-4), 1u);
  EXPECT_EQ(num_places(0, RadFromDeg(3.01), 1e-4), 2u);
  // 2 sqrt(0.1^2 + 0.05^2) = 0.2236
  EXPECT_EQ(num_places(0.221, 0, 0.1), 1u);
  EXPECT_EQ(num_places(0.226, 0, 0.1), 2u);
  // The same beside it.
  PoseBelief beside(kAreaM2);
  beside.Update(
      std::vector{Place(1, 1, 0, 0.5, 1e-4), Place(1, 1.098, 0, 0.3, 1), Place(1, 1.102, 0, 0.1, 1)});
  ASSERT_EQ(beside.places().size(), 2u);
  EXPECT_NEAR(beside.places()[0].probability, 0.98 * 0.8, 1e-12);
  EXPECT_EQ(beside.places()[1].pose.position.y(), 1.102);
}

TEST(PoseBelief, EquallyProbablePlacesStayInTheOrderInWhichTheyWereTold) {
  PoseBelief belief(kAreaM2);
  belief.Update(std::vector{Place(1, 1, 0, 0.25), Place(6, 6, 0, 0.25), Place(3, 9, 0, 0.25)});
  ASSERT_EQ(belief.places().size(), 3u);
  EXPECT_EQ(belief.places()[0].pose.position.x(), 1);
  EXPECT_EQ(belief.places()[1].pose.position.x(), 6);
  EXPECT_EQ(belief.places()[2].pose.position.x(), 3);
}

// A look that agrees with a place makes it many times as probable as chance; another place is given up by its
// share of what then is all.
TEST(PoseBelief, PlacesAreGivenUpByTheirShareOfAll) {
  PoseBelief belief(kAreaM2, {.surprise_ratio = 0.1, .least_probability = 0.01});
  belief.Update(std::vector{Place(1, 1, 0, 0.8), Place(8, 8, 0, 0.2)});
  ASSERT_EQ(belief.places().size(), 2u);
  belief.Update(std::vector{Place(1, 1, 0, 1)});
  ASSERT_EQ(belief.places().size(), 1u);  // the other's share: 0.1 * 0.18 / (0.9 * 0.72 * 600 * 22.4) = 2e-6
  EXPECT_NEAR(Sum(belief), 1, 1e-12);
}

TEST(PoseBelief, WhatIsNoLookIsLeftOutOfTheOthers) {
  const PossiblePlace good = Place(2, 2, 0.5, 0.7), last = Place(5, 5, 0, 0.2);
  PossiblePlace no_covariance = Place(1, 1, 0, 0.5);
  no_covariance.covariance(1, 1) = NAN;
  for (const PossiblePlace& bad : {Place(NAN, 1, 0, 0.5), Place(1, 1, INFINITY, 0.5), Place(1, 1, 0, NAN),
                                   Place(1, 1, 0, -0.5), Place(1, 1, 0, INFINITY), no_covariance}) {
    PoseBelief with(kAreaM2), without(kAreaM2);
    with.Update(std::vector{good, bad, last});
    without.Update(std::vector{good, last});
    ASSERT_EQ(with.places().size(), 2u);
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(with.places()[i].pose.position, without.places()[i].pose.position);
      EXPECT_EQ(with.places()[i].probability, without.places()[i].probability);
    }
    EXPECT_EQ(with.elsewhere(), without.elsewhere());
  }
}

// Four standard deviations of both: 4 sqrt(0.01 + 0.01) = 0.566.
TEST(PoseBelief, PlacesAreCorrectedByWhatIsNear) {
  const auto x_after = [](double seen_x, double variance) {
    PossiblePlace place = Place(1, 1, 0, 0.6), seen = Place(seen_x, 1, 0, 0.9);
    place.covariance = seen.covariance = variance * Eigen::Matrix3d::Identity();
    PoseBelief belief(kAreaM2);
    belief.Update(std::vector{place});
    belief.Correct(std::vector{seen});
    return belief.places()[0].pose.position.x();
  };
  EXPECT_NEAR(x_after(1.56, 0.01), 1.28, 1e-12);
  EXPECT_EQ(x_after(1.57, 0.01), 1);
  EXPECT_EQ(x_after(3, 0.125), 1);  // just not: 2^2 / 0.25 = 16
}

TEST(PoseBelief, ACorrectedPlaceIsKnownAsWellAsTheBetterOfBoth) {
  for (const double seen_sigma : {0.05, 0.2}) {
    PoseBelief belief(kAreaM2);
    belief.Update(std::vector{Place(1, 1, 0, 0.6, 0.1)});
    belief.Correct(std::vector{Place(1.1, 1, 0, 0.9, seen_sigma)});
    EXPECT_NEAR(belief.places()[0].covariance(0, 0), std::pow(std::min(0.1, seen_sigma), 2), 1e-15);
  }
}

// A place is corrected by what is likeliest there: by its probability and by how near it is.
TEST(PoseBelief, TheLikeliestOfWhatIsNearCorrects) {
  PoseBelief before(kAreaM2);
  before.Update(std::vector{Place(1, 1, 0, 0.6)});
  // exp(-d^2 / 0.04) of each: 0.01 * 0.9, 0.4 * 0.37, 0.5 * 0.1.
  const std::vector<PossiblePlace> seen = {Place(1.06, 1, 0, 0.01), Place(0.8, 1, 0, 0.4),
                                           Place(1.3, 1, 0, 0.5)};
  std::vector<int> order = {0, 1, 2};
  do {
    PoseBelief belief = before;
    belief.Correct(std::vector{seen[order[0]], seen[order[1]], seen[order[2]]});
    EXPECT_NEAR(belief.places()[0].pose.position.x(), 0.9, 1e-12);
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST(PoseBelief, OptionsHaveTheirRanges) {
  PoseBeliefOptions options;
  const auto is_allowed = [&] { return CheckOptions(DescribeOptions(&options)).ok(); };
  for (double* ratio : {&options.surprise_ratio, &options.lost_ratio, &options.least_probability}) {
    const double usual = *ratio;
    *ratio = 0.5;
    EXPECT_TRUE(is_allowed());
    *ratio = 0.51;
    EXPECT_FALSE(is_allowed());
    *ratio = 0;
    EXPECT_FALSE(is_allowed());
    *ratio = usual;
  }
  options.max_num_places = 1;
  EXPECT_TRUE(is_allowed());
  options.max_num_places = 0;
  EXPECT_FALSE(is_allowed());
}

}  // namespace
}  // namespace cairn
