#include "runtime/localize/accept.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(JudgeGuided, NoMoreThanByChanceIsRefused) {
  const AcceptOptions options{.min_guided_sigmas = 5};
  // 9 + 5 x 3 = 24
  EXPECT_EQ(JudgeGuided(24, 9, options).reason, NoFix::kNone);
  EXPECT_EQ(JudgeGuided(23, 9, options).reason, NoFix::kTooFewInliers);
  EXPECT_EQ(JudgeGuided(23, 9, {.min_guided_sigmas = 0}).reason, NoFix::kNone);
  EXPECT_EQ(JudgeGuided(8, 9, {.min_guided_sigmas = 0}).reason, NoFix::kNone) << "not tested";
  // 9 + 0.5 x 3 = 10.5
  EXPECT_EQ(JudgeGuided(11, 9, {.min_guided_sigmas = 0.5}).reason, NoFix::kNone);
  EXPECT_EQ(JudgeGuided(10, 9, {.min_guided_sigmas = 0.5}).reason, NoFix::kTooFewInliers);
}

// A fix at x metres with so many matches and these odds.
Localization FixAt(double x_m, int num_matches, double odds) {
  Localization found;
  found.reason = NoFix::kNone;
  found.cam_from_world = {Eigen::Quaterniond::Identity(), {-x_m, 0, 0}};
  found.num_unguided_inliers = num_matches;
  found.probability = odds / (1 + odds);
  return found;
}

constexpr double kAsLikely = 1;

TEST(DecideAmong, TheFixWithMostMatchesSharesProbabilityWithOtherPlaces) {
  // 30 / (1 + 30 + 9)
  const Localization decided = DecideAmong({FixAt(0, 10, 9), FixAt(5, 40, 30)}, kAsLikely, {});
  ASSERT_TRUE(decided.has_fix());
  EXPECT_DOUBLE_EQ(decided.cam_from_world.Center().x(), 5);
  EXPECT_NEAR(decided.probability, 0.75, 1e-12);
}

TEST(DecideAmong, APlaceFoundTwiceCountsOnce) {
  // The second at 5 m is the first, with another odds; half a metre apart is still one place.
  const Localization decided =
      DecideAmong({FixAt(0, 40, 30), FixAt(5, 10, 9), FixAt(5.5, 8, 9), FixAt(5, 9, 9)}, kAsLikely, {});
  EXPECT_NEAR(decided.probability, 0.75, 1e-12);
  // Another place: 30 / (1 + 30 + 9 + 9).
  EXPECT_NEAR(DecideAmong({FixAt(0, 40, 30), FixAt(5, 10, 9), FixAt(5.6, 8, 9)}, kAsLikely, {}).probability,
              30.0 / 49, 1e-12);
}

TEST(DecideAmong, AsManyMatchesAreAmbiguous) {
  // 0.6 of 40 are 24.
  EXPECT_TRUE(DecideAmong({FixAt(0, 40, 30), FixAt(5, 23, 9)}, kAsLikely, {}).has_fix());
  const Localization decided = DecideAmong({FixAt(5, 24, 9), FixAt(0, 40, 30)}, kAsLikely, {});
  EXPECT_EQ(decided.reason, NoFix::kAmbiguous);
  EXPECT_EQ(decided.message, "40 and 24 matches agree on poses at different places");
  ASSERT_EQ(decided.possible_poses.size(), size_t{2});
  EXPECT_DOUBLE_EQ(decided.possible_poses[1].Center().x(), 5);
  EXPECT_NEAR(decided.possible_probabilities[0], 0.75, 1e-12);
  EXPECT_NEAR(decided.possible_probabilities[1], 0.225, 1e-12);
  EXPECT_NEAR(decided.probability, 0.975, 1e-12);
  EXPECT_TRUE(
      DecideAmong({FixAt(5, 24, 9), FixAt(0, 40, 30)}, kAsLikely, {.max_second_pose_ratio = 0}).has_fix())
      << "not looked for";
}

TEST(DecideAmong, SoIsAPlaceThatIsNearlyAsLikelyHoweverFewMatchesItHas) {
  EXPECT_TRUE(DecideAmong({FixAt(0, 40, 30), FixAt(5, 10, 30)}, 1, {}).has_fix());
  EXPECT_FALSE(DecideAmong({FixAt(0, 40, 30), FixAt(5, 10, 31)}, 1, {}).has_fix());
  EXPECT_FALSE(DecideAmong({FixAt(0, 40, 1000), FixAt(5, 10, 11)}, 100, {}).has_fix());
  EXPECT_TRUE(DecideAmong({FixAt(0, 40, 1000), FixAt(5, 10, 9)}, 100, {}).has_fix());
  // But a thousand times less likely is not counted.
  EXPECT_FALSE(DecideAmong({FixAt(0, 40, 1000), FixAt(5, 39, 1.1)}, 100, {}).has_fix());
  EXPECT_TRUE(DecideAmong({FixAt(0, 40, 1000), FixAt(5, 39, 0.9)}, 100, {}).has_fix());
}

TEST(DecideAmong, AFixAtAPlaceOfAnAmbiguousAnswerDoesNotDecideForIt) {
  const Localization ambiguous = DecideAmong({FixAt(0, 40, 30), FixAt(5, 40, 30)}, kAsLikely, {});
  ASSERT_EQ(ambiguous.reason, NoFix::kAmbiguous);
  const Localization still = DecideAmong({ambiguous, FixAt(5, 40, 30)}, kAsLikely, {});
  EXPECT_EQ(still.reason, NoFix::kAmbiguous);
  EXPECT_EQ(still.possible_poses.size(), size_t{2});
  EXPECT_NEAR(still.possible_probabilities[0], 30.0 / 61, 1e-9);
  EXPECT_EQ(DecideAmong({ambiguous, FixAt(5, 60, 30)}, kAsLikely, {}).reason, NoFix::kAmbiguous);
  EXPECT_EQ(DecideAmong({FixAt(5, 40, 30), ambiguous}, kAsLikely, {}).reason, NoFix::kAmbiguous);
  // Many more matches somewhere decide.
  EXPECT_TRUE(DecideAmong({ambiguous, FixAt(9, 70, 300)}, kAsLikely, {}).has_fix());
}

TEST(DecideAmong, AHopelessPlaceIsNotCountedHoweverManyMatchesItHas) {
  const Localization decided = DecideAmong({FixAt(0, 90, 0.9), FixAt(5, 20, 1000)}, 100, {});
  ASSERT_TRUE(decided.has_fix());
  EXPECT_DOUBLE_EQ(decided.cam_from_world.Center().x(), 5);
  EXPECT_EQ(DecideAmong({FixAt(0, 90, 1.1), FixAt(5, 20, 1000)}, 100, {}).reason, NoFix::kAmbiguous);
}

TEST(DecideAmong, AFixKnowsItsPlaceBetterThanAnAmbiguousAnswerDoes) {
  const Localization ambiguous = DecideAmong({FixAt(0, 40, 30), FixAt(5, 40, 30)}, kAsLikely, {});
  // The fix at 5 m has fewer matches, and odds that leave the other place far behind.
  const Localization decided = DecideAmong({ambiguous, FixAt(5, 30, 1e6)}, kAsLikely, {});
  ASSERT_TRUE(decided.has_fix()) << decided.message;
  EXPECT_DOUBLE_EQ(decided.cam_from_world.Center().x(), 5);
}

}  // namespace
}  // namespace cairn
