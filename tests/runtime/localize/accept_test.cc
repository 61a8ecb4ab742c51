#include "runtime/localize/accept.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(FoundLogOdds, IsARatioOfTwoBinomialLikelihoods) {
  // 25 ln(0.25 / (5 / 101)) + 75 ln(0.75 / (96 / 101))
  EXPECT_NEAR(FoundLogOdds(25, 100, 5, 0.25), 22.7165, 1e-4);
  // More than a right pose finds at least: the likeliest rate, 0.8.
  EXPECT_NEAR(FoundLogOdds(80, 100, 5, 0.25), 191.4298, 1e-4);
  // 12 where a right pose finds 25 and chance 4: neither is clearly likelier.
  EXPECT_NEAR(FoundLogOdds(12, 100, 4, 0.25), 0.3504, 1e-4);
}

TEST(FoundLogOdds, NoneByChanceCountsAsHalfOfOne) {
  EXPECT_DOUBLE_EQ(FoundLogOdds(10, 100, 0, 0.25), FoundLogOdds(10, 100, 0.5, 0.25));
  EXPECT_LT(FoundLogOdds(10, 100, 0.6, 0.25), FoundLogOdds(10, 100, 0.5, 0.25));
}

TEST(FoundLogOdds, IsFiniteWhereAllOrNoneAreFound) {
  EXPECT_LT(FoundLogOdds(0, 100, 5, 0.25), -20);
  EXPECT_TRUE(std::isfinite(FoundLogOdds(0, 100, 5, 0.25)));
  EXPECT_GT(FoundLogOdds(100, 100, 5, 0.25), 200);
  EXPECT_TRUE(std::isfinite(FoundLogOdds(100, 100, 5, 0.25)));
  EXPECT_NEAR(FoundLogOdds(100, 100, 200, 0.25), 0, 1e-9);  // as many beside as there can be
  EXPECT_EQ(FoundLogOdds(0, 0, 0, 0.25), -std::numeric_limits<double>::infinity());
}

TEST(JudgeGuided, NoMoreThanByChanceIsRefused) {
  const AcceptOptions options{.min_guided_sigmas = 5, .min_found_ratio = 0};
  // 9 + 5 x 3 = 24
  EXPECT_EQ(JudgeGuided({24, 100, 9, true}, options).reason, NoFix::kNone);
  EXPECT_EQ(JudgeGuided({23, 100, 9, true}, options).reason, NoFix::kTooFewInliers);
  EXPECT_EQ(JudgeGuided({23, 100, 9, true}, {.min_guided_sigmas = 0, .min_found_ratio = 0}).reason,
            NoFix::kNone);
}

// A held-out image of the demo that shows a panel which two places have: 42 landmarks where the wrong pose
// says, 14.5 beside it, of 359 in view.  Another, right one before a bare wall: 29, none beside, of 242.
TEST(JudgeGuided, PartOfAnImageThatLooksLikeAnotherPlaceIsRefused) {
  const AcceptOptions options;
  const GuidedEvidence look_alike{42, 359, 14.5, false}, bare_wall{29, 242, 0.5, false};
  EXPECT_EQ(JudgeGuided(look_alike, options).reason, NoFix::kTooFewInliers);
  EXPECT_NE(JudgeGuided(look_alike, options).message.find("a right pose finds more"), std::string::npos);
  EXPECT_EQ(JudgeGuided(bare_wall, options).reason, NoFix::kNone);
}

TEST(JudgeGuided, WhereEnoughMatchesLedToThePoseFewOfThoseInViewWillDo) {
  const GuidedEvidence sure{42, 359, 14.5, true};
  EXPECT_EQ(JudgeGuided(sure, {}).reason, NoFix::kNone);
  EXPECT_EQ(JudgeGuided({42, 359, 14.5, false}, {.min_found_ratio = 0}).reason, NoFix::kNone);
  EXPECT_EQ(JudgeGuided({42, 359, 14.5, false}, {.min_found_log_odds = -2}).reason, NoFix::kNone);
}

}  // namespace
}  // namespace cairn
