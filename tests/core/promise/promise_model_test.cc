#include "core/promise/promise_model.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(NegativeBinomialTail, IsThatOfGeometricAndPoissonNumbers) {
  // Shape 1: geometric, P(N >= n) = (mean / (1 + mean))^n.
  EXPECT_NEAR(NegativeBinomialTail(3, 2, 1), std::pow(2.0 / 3, 3), 1e-12);
  EXPECT_DOUBLE_EQ(NegativeBinomialTail(0, 2, 1), 1);
  // A large shape: Poisson, P(N >= 2) = 1 - e^-m (1 + m).
  EXPECT_NEAR(NegativeBinomialTail(2, 1.5, 1e7), 1 - std::exp(-1.5) * 2.5, 1e-6);
  EXPECT_NEAR(NegativeBinomialTail(2, 0, 5), 0, 1e-12);
}

TEST(PromiseModel, BothConditionsCount) {
  const PromiseModel model{.match_ratio = 1, .shape = 1, .error_ratio = 1};
  const PromiseTerms terms{.min_matches = 2, .max_error_m = 0.1};
  const double tail = std::pow(8.0 / 9, 2);
  EXPECT_NEAR(model.Probability({8, 0}, terms), tail, 1e-12);
  // Limits of one standard deviation along each axis: Maxwell's distribution has 0.19875 within.
  EXPECT_NEAR(model.Probability({8, 0.1 * std::sqrt(3.0)}, terms), 0.198748 * tail, 1e-6);
  // Twice as many matches, errors half as large as stated.
  const PromiseModel better{.match_ratio = 2, .shape = 1, .error_ratio = 0.5};
  EXPECT_NEAR(better.Probability({4, 0.2 * std::sqrt(3.0)}, terms), 0.198748 * tail, 1e-6);
  EXPECT_EQ(model.Probability({0, 0.01}, terms), 0);
}

TEST(PromiseModel, WhatIsNeededJustKeepsThePromise) {
  const PromiseModel model{.match_ratio = 0.5, .shape = 3, .error_ratio = 2};
  for (const double probability : {0.5, 0.95}) {
    const PromiseTerms terms{.min_matches = 6, .max_error_m = 0.2, .probability = probability};
    const Expectation least{model.NeededMatches(terms), model.LargestSigmaM(terms)};
    EXPECT_NEAR(model.Probability(least, terms), probability, 1e-6);
    EXPECT_NEAR(model.Probability({least.num_matches, 0}, terms), std::sqrt(probability), 1e-6);
  }
  EXPECT_GE(PromiseModel{.match_ratio = 0}.NeededMatches({}), 1e6);
}

TEST(FitPromiseModel, FindsWhatTheTrialsWereDrawnFrom) {
  std::mt19937_64 engine(1);
  std::vector<PromiseTrial> trials;
  for (int i = 0; i < 4000; ++i) {
    PromiseTrial trial{.expected = {20.0 + i % 30, 0.05}, .is_right = true};
    std::gamma_distribution<double> gamma(4, 1.0 / 4);
    trial.num_matches =
        std::poisson_distribution<int>(0.8 * trial.expected.num_matches * gamma(engine))(engine);
    std::normal_distribution<double> error(0, 1.5 * 0.05 / std::sqrt(3.0));
    trial.error_m = std::hypot(error(engine), error(engine), error(engine));
    trials.push_back(trial);
  }
  const PromiseModel model = FitPromiseModel(trials);
  EXPECT_NEAR(model.match_ratio, 0.8, 0.02);
  EXPECT_NEAR(model.shape, 4, 0.6);
  EXPECT_NEAR(model.error_ratio, 1.5, 0.03);
  // Images that are not localized make promises more careful, but do not count in the ratios.
  for (int i = 0; i < 400; ++i) trials.push_back({.expected = {30, 0.05}, .num_matches = 12, .error_m = 9});
  const PromiseModel careful = FitPromiseModel(trials);
  EXPECT_DOUBLE_EQ(careful.match_ratio, model.match_ratio);
  EXPECT_DOUBLE_EQ(careful.error_ratio, model.error_ratio);
  EXPECT_LT(careful.shape, 0.7 * model.shape);
}

TEST(FitPromiseModel, WithoutARightImageNothingIsPromised) {
  EXPECT_EQ(FitPromiseModel({{.expected = {50, 0.01}}}).Probability({1000, 0}, {}), 0);
  EXPECT_EQ(FitPromiseModel({}).Probability({1000, 0}, {}), 0);
  EXPECT_EQ(FitPromiseModel({{.expected = {0, 0}, .is_right = true}}).match_ratio, 0);
}

TEST(CalibrationCurve, BinsWhatWasPromised) {
  EXPECT_THAT(CalibrationCurve({}), IsEmpty());
  EXPECT_THAT(
      CalibrationCurve({{0.96, true}, {0.2, false}, {0.95, true}, {0.97, false}, {1, true}}),
      ElementsAre(
          PromiseBin{.least = 0, .num = 1, .num_kept = 0, .mean_promised = 0.2},
          PromiseBin{.least = 0.95, .num = 3, .num_kept = 2, .mean_promised = (0.96 + 0.95 + 0.97) / 3},
          PromiseBin{.least = 0.995, .num = 1, .num_kept = 1, .mean_promised = 1}));
}

}  // namespace
}  // namespace cairn
