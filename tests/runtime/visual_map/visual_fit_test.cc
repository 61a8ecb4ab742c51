// The turn of a camera by what it sees of a visual map: derivatives by differences, scores by hand.
#include "runtime/visual_map/visual_fit.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "core/base/random.h"
#include "core/camera/camera_turn.h"

namespace cairn {
namespace {

constexpr double kFocalPx = 500;

FitItem ItemAt(double x, double y, double rise = 0) {
  FitItem item;
  item.seen = item.predicted = {x, y, 2};
  item.variance = {4, 1, 0.25};
  item.rise = rise;
  item.log_odds = 200;  // right for sure
  return item;
}

// Items spread over the image, as they appear after a turn.
std::vector<FitItem> ItemsAfter(const Turn& turn, double log_odds = 200) {
  Random random(1);
  std::vector<FitItem> items;
  for (int i = 0; i < 12; ++i) {
    const double x = random.Uniform(-300, 300), y = random.Uniform(-200, 200), rise = random.Uniform(0, 200);
    FitItem item = ItemAt(x, y, rise);
    item.seen = *TurnedSight(LiftedPrediction(item, turn.higher_m),
                             CameraTurn(turn.left, turn.up, turn.clockwise), kFocalPx);
    item.log_odds = log_odds;
    items.push_back(item);
  }
  return items;
}

// What FitTurn makes largest: ln of the prior's density but for its factor, and of the items' ratios.
double LogOf(const std::vector<FitItem>& items, const TurnFitOptions& options, const Turn& turn) {
  double sum = -0.5 * (std::pow(turn.up / options.tilt_sigma_rad, 2) +
                       std::pow(turn.clockwise / options.tilt_sigma_rad, 2) +
                       std::pow(turn.higher_m / options.height_sigma_m, 2));
  for (const FitItem& item : items) {
    const auto shown = TurnedSight(LiftedPrediction(item, turn.higher_m),
                                   CameraTurn(turn.left, turn.up, turn.clockwise), options.focal_px);
    sum += ScoreItem(item, *shown - item.seen).log_ratio;
  }
  return sum;
}

double& Parameter(Turn& turn, int i) {
  return i == 0 ? turn.left : i == 1 ? turn.up : i == 2 ? turn.clockwise : turn.higher_m;
}

TEST(ScoreItem, IsTheLogarithmOfOneAndTheOdds) {
  FitItem item = ItemAt(0, 0);
  item.log_odds = 1;
  // 2^2 / 4 + 1^2 / 1 + 0.5^2 / 0.25 = 3
  const double odds = std::exp(1 - 0.5 * 3);
  const ItemScore score = ScoreItem(item, {2, -1, 0.5});
  EXPECT_NEAR(score.log_ratio, std::log(1 + odds), 1e-12);
  EXPECT_NEAR(score.weight, odds / (1 + odds), 1e-12);
  // Of odds too large for their exponential, too.
  for (const double log_odds : {29.9, 30.1, 2000.0}) {
    item.log_odds = log_odds;
    EXPECT_NEAR(ScoreItem(item, {0, 0, 0}).log_ratio, log_odds, 1e-9);
    EXPECT_NEAR(ScoreItem(item, {0, 0, 0}).weight, 1, 1e-9);
  }
}

TEST(ItemError, IsWhatTheTurnedPredictionIsOff) {
  FitItem item = ItemAt(120, -80, 90);
  item.seen = {100, -50, 1.5};
  const Eigen::Matrix3d turn = CameraTurn(0.1, -0.05, 0.2);
  Eigen::Vector3d error;
  Eigen::Matrix<double, 3, 4> jacobian;
  ASSERT_TRUE(ItemError(item, turn, 0.3, kFocalPx, &error, &jacobian));
  const auto shown_at = [&](const Eigen::Matrix3d& turned, double higher_m) {
    // 90 px a metre lower in the image.
    return *TurnedSight(Eigen::Vector3d(120, -80 + 90 * higher_m, 2), turned, kFocalPx);
  };
  EXPECT_LT((error - (shown_at(turn, 0.3) - item.seen)).norm(), 1e-9);
  constexpr double kStep = 1e-6;
  const std::function<Eigen::Matrix3d(double)> turns[] = {
      [](double angle) { return CameraTurn(angle, 0, 0); },
      [](double angle) { return CameraTurn(0, angle, 0); },
      [](double angle) { return CameraTurn(0, 0, angle); }};
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d derivative =
        (shown_at(turns[i](kStep) * turn, 0.3) - shown_at(turns[i](-kStep) * turn, 0.3)) / (2 * kStep);
    EXPECT_LT((jacobian.col(i) - derivative).head<2>().norm(), 1e-4 * derivative.norm()) << i;
    EXPECT_EQ(jacobian(2, i), 0);  // the scale's own change is left out
  }
  const Eigen::Vector3d by_height = (shown_at(turn, 0.3 + kStep) - shown_at(turn, 0.3 - kStep)) / (2 * kStep);
  EXPECT_LT((jacobian.col(3) - by_height).head<2>().norm(), 1e-4 * by_height.norm());
}

TEST(ItemError, IsNoneOfWhatIsOutOfSight) {
  Eigen::Vector3d error;
  Eigen::Matrix<double, 3, 4> jacobian;
  EXPECT_TRUE(ItemError(ItemAt(0, 0), CameraTurn(1.3), 0, kFocalPx, &error, &jacobian));
  EXPECT_FALSE(ItemError(ItemAt(0, 0), CameraTurn(1.45), 0, kFocalPx, &error, &jacobian));
}

TEST(TurnGradient, IsThatOfWhereThingsAppear) {
  const Eigen::Matrix3d turn = CameraTurn(0.3, -0.2, 0.4);
  for (const Eigen::Vector3d& predicted : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(-220, 170, 3)}) {
    const Eigen::Matrix3d gradient = TurnGradient(predicted, turn, kFocalPx);
    constexpr double kStep = 1e-4;
    for (int i = 0; i < 2; ++i) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i);
      const Eigen::Vector3d derivative =
          (*TurnedSight(predicted + step, turn, kFocalPx) - *TurnedSight(predicted - step, turn, kFocalPx)) /
          (2 * kStep);
      EXPECT_LT((gradient.col(i) - derivative).head<2>().norm(), 1e-6) << i;
      EXPECT_EQ(gradient(2, i), 0);
    }
    EXPECT_EQ(Eigen::Vector3d(gradient.col(2)), Eigen::Vector3d::UnitZ());
  }
}

// Of two groups of turns the larger, by the mean of the three bins around it.
TEST(VoteForLeft, TakesWhatMostItemsSay) {
  const auto turned = [](double left_rad) {
    FitItem item = ItemAt(50, 0);
    item.seen.x() = kFocalPx * std::tan(std::atan(50 / kFocalPx) + left_rad);
    return item;
  };
  const TurnFitOptions options{.focal_px = kFocalPx, .max_left_rad = 0.5};
  EXPECT_EQ(VoteForLeft({}, options), 0);
  EXPECT_NEAR(VoteForLeft({turned(0.11), turned(0.12), turned(-0.3), turned(-0.3), turned(0.13)}, options),
              0.12, 1e-9);
  EXPECT_NEAR(VoteForLeft({turned(0.11), turned(-0.31), turned(-0.29), turned(0.25)}, options), -0.3, 1e-9);
  // No farther than it may be.
  EXPECT_NEAR(VoteForLeft({turned(0.51), turned(0.52), turned(-0.51), turned(0.1)}, options), 0.1, 1e-9);
  EXPECT_EQ(VoteForLeft({turned(0.51), turned(0.52)}, options), 0);
  EXPECT_NEAR(VoteForLeft({turned(0.495), turned(0.499), turned(0.1)}, options), 0.497, 1e-9);
  EXPECT_NEAR(VoteForLeft({turned(-0.495), turned(-0.499), turned(0.1)}, options), -0.497, 1e-9);
  // In bins of 2 degrees: what is 3 of them apart are two groups.
  constexpr double kBin = 2 * std::numbers::pi / 180;
  EXPECT_NEAR(VoteForLeft({turned(2 * kBin), turned(3 * kBin), turned(4 * kBin), turned(6 * kBin)}, options),
              3 * kBin, 1e-9);
}

TEST(LogTurnPrior, IsOfADensityOfTiltAndHeight) {
  // A circle of headings, two normal angles and a normal height, at their middle.
  const double root = std::sqrt(2 * std::numbers::pi);
  EXPECT_NEAR(LogTurnPrior({.tilt_sigma_rad = 0.04, .height_sigma_m = 0.3}),
              std::log(1 / (2 * std::numbers::pi) / std::pow(0.04 * root, 2) / (0.3 * root)), 1e-12);
}

TEST(FitTurn, FindsTheLikeliestTurn) {
  const TurnFitOptions options{.focal_px = kFocalPx, .tilt_sigma_rad = 0.05, .height_sigma_m = 0.1};
  const Turn truth{.left = 0.2, .up = 0.04, .clockwise = -0.03, .higher_m = 0.08};
  const std::vector<FitItem> items = ItemsAfter(truth);
  Turn found{.left = 0.15};
  FitTurn(items, options, 20, &found);
  const double most = LogOf(items, options, found);
  EXPECT_GE(most, LogOf(items, options, truth));
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(Parameter(found, i), Parameter(const_cast<Turn&>(truth), i), 0.005) << i;
    for (const double step : {-1e-3, 1e-3}) {
      Turn other = found;
      Parameter(other, i) += step;
      EXPECT_LT(LogOf(items, options, other), most) << i;
    }
  }
  // A step at a time.
  Turn none{.left = 0.15};
  FitTurn(items, options, 0, &none);
  EXPECT_EQ(none.left, 0.15);
}

// By Laplace: of a normal density the integral is that of its second derivatives.
TEST(FitTurn, GivesTheIntegralOverTurnsAndHeights) {
  const TurnFitOptions options{.focal_px = kFocalPx, .tilt_sigma_rad = 0.05, .height_sigma_m = 0.1};
  const std::vector<FitItem> items = ItemsAfter({});  // seen as predicted
  constexpr double kStep = 1e-4;
  Eigen::Matrix4d curvature;
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 4; ++k) {
      double sum = 0;
      for (const double a : {-kStep, kStep}) {
        for (const double b : {-kStep, kStep}) {
          Turn turn;
          Parameter(turn, i) += a;
          Parameter(turn, k) += b;
          sum += (a * b > 0 ? 1 : -1) * LogOf(items, options, turn);
        }
      }
      curvature(i, k) = -sum / (4 * kStep * kStep);
    }
  }
  curvature(0, 0) += 1;  // a turn is known to a radian
  Turn turn;
  const double found = FitTurn(items, options, 3, &turn);
  EXPECT_NEAR(turn.left, 0, 1e-9);
  const double expected = 12 * 200 + LogTurnPrior(options) + 2 * std::log(2 * std::numbers::pi) -
                          0.5 * std::log(curvature.determinant());
  EXPECT_NEAR(found, expected, 0.02);
  // Without items it is that of the prior, times what a radian is of a circle.
  EXPECT_NEAR(FitTurn({}, options, 3, &turn), -0.5 * std::log(2 * std::numbers::pi), 1e-9);
}

// Six standard deviations off they would have no weight: the first step takes errors as if they were three
// times as large.
TEST(FitTurn, FirstStepSeesWhatIsFarOff) {
  const TurnFitOptions options{.focal_px = kFocalPx, .tilt_sigma_rad = 0.05, .height_sigma_m = 0.1};
  const std::vector<FitItem> items = ItemsAfter({.left = 12 / kFocalPx}, 5);
  Turn found;
  FitTurn(items, options, 3, &found);
  EXPECT_NEAR(found.left, 12 / kFocalPx, 1e-4);
  // But not ten.
  found = {};
  FitTurn(ItemsAfter({.left = 50 / kFocalPx}, 1), options, 3, &found);
  EXPECT_LT(found.left, 10 / kFocalPx);
}

TEST(FitTurn, TurnsNoFartherThanItMay) {
  const TurnFitOptions options{
      .focal_px = kFocalPx, .tilt_sigma_rad = 5, .height_sigma_m = 0.1, .max_left_rad = 0.3};
  // Of things that are hardly where they are, so that none is far off.
  const auto after = [](const Turn& turn) {
    std::vector<FitItem> items = ItemsAfter(turn);
    for (FitItem& item : items) item.variance = {1e4, 1e4, 100};
    return items;
  };
  for (const double sign : {-1.0, 1.0}) {
    Turn found;
    FitTurn(after({.left = sign * 0.5}), options, 10, &found);
    EXPECT_EQ(found.left, sign * 0.3);
    found = {};
    FitTurn(after({.up = sign * 0.7}), options, 10, &found);
    EXPECT_EQ(found.up, sign * 0.5);
    found = {};
    FitTurn(after({.clockwise = sign * 0.8}), options, 10, &found);
    EXPECT_EQ(found.clockwise, sign * 0.5);
  }
}

}  // namespace
}  // namespace cairn
