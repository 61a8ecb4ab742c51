#include "stages/emit_map/choose/fewest_size.h"

#include <gtest/gtest.h>

namespace cairn::emit_map {
namespace {

TEST(IsotonicRegression, PoolsWhatGetsWorse) {
  EXPECT_EQ(IsotonicRegression({1, 2, 3}), (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(IsotonicRegression({1, 4, 2, 5}), (std::vector<double>{1, 3, 3, 5}));
  // 3 and 1 make 2, which the 1.5 after it pulls down in turn, but not below the first.
  EXPECT_EQ(IsotonicRegression({0, 3, 1, 0.5}), (std::vector<double>{0, 1.5, 1.5, 1.5}));
  EXPECT_EQ(IsotonicRegression({3, 2, 1}), (std::vector<double>{2, 2, 2}));
  EXPECT_TRUE(IsotonicRegression({}).empty());
}

TEST(FewestThatDo, LiesBetweenTheSizesAsTheErrorsDoInTheLogarithm) {
  // Errors 0.3 at 100 landmarks and 0.1 at 400: 0.2, halfway, at 200.
  const std::vector<SizeTrial> trials = {{400, 10, 0.1}, {100, 10, 0.3}, {1600, 10, 0}};
  EXPECT_EQ(FewestThatDo(trials, {10, 0.2}), 200u);
  EXPECT_EQ(FewestThatDo(trials, {10, 0.1}), 400u);
  EXPECT_EQ(FewestThatDo(trials, {10, 0.05}), 800u);
  EXPECT_EQ(FewestThatDo(trials, {10, 0.3}), 100u);
}

TEST(FewestThatDo, IsNotTheSizeThatHappensToDo) {
  // 200 is good by chance: with 400 its errors are 0.2 on average, so 0.15 is a quarter of the way to 800.
  const std::vector<SizeTrial> trials = {{100, 10, 0.4}, {200, 10, 0.1}, {400, 10, 0.3}, {800, 10, 0}};
  EXPECT_EQ(FewestThatDo(trials, {10, 0.15}), 476u);  // 400 x 2^(1/4)
  EXPECT_EQ(FewestThatDo(trials, {10, 0.2}), 200u);
}

TEST(FewestThatDo, ImagesMustBeLocalizedAtThatSize) {
  // Errors are small enough from 100 on, but images are lost up to 200.
  const std::vector<SizeTrial> trials = {{100, 8, 0.1}, {200, 8, 0.1}, {400, 10, 0.05}, {800, 10, 0}};
  EXPECT_EQ(FewestThatDo(trials, {9, 0.2}), 400u);
  EXPECT_EQ(FewestThatDo(trials, {8, 0.2}), 100u);
}

TEST(FewestThatDo, AnImageLostByChanceWithMoreLandmarksCountsInPart) {
  const std::vector<SizeTrial> trials = {
      {100, 7, 0.1}, {200, 10, 0.1}, {400, 9, 0.1}, {800, 10, 0}};  // regression: 7, 9.5, 9.5, 10
  EXPECT_EQ(FewestThatDo(trials, {9.4, 0.2}), 200u);
  EXPECT_EQ(FewestThatDo(trials, {9.6, 0.2}), 800u);
}

// Of four images the first is lost with few, the second by chance, the third always, the fourth never.
TEST(WithoutChance, ImagesThatFewerLocalizeAndMoreDoNotCountAsLocalized) {
  const std::vector<TriedSize> tried = {{{100, 1, 0.3}, {0, 0, 0, 1}},
                                        {{200, 2, 0.2}, {0, 1, 0, 1}},
                                        {{400, 2, 0.1}, {1, 0, 0, 1}},
                                        {{800, 3, 0}, {1, 1, 0, 1}}};
  const std::vector<SizeTrial> trials = WithoutChance(tried);
  ASSERT_EQ(trials.size(), 4U);
  EXPECT_EQ(trials[0].num_right, 2);
  EXPECT_EQ(trials[1].num_right, 2);
  EXPECT_EQ(trials[2].num_right, 3);
  EXPECT_EQ(trials[3].num_right, 3);
  EXPECT_EQ(trials[1].num_landmarks, 200U);
  EXPECT_EQ(trials[1].log_error_ratio, 0.2);
  EXPECT_TRUE(WithoutChance({}).empty());
}

TEST(FewestThatDo, NothingWhereNoSizeWillDo) {
  EXPECT_FALSE(FewestThatDo({{100, 10, 0.5}, {200, 10, 0.3}}, {10, 0.2}).has_value());
  EXPECT_FALSE(FewestThatDo({{100, 9, 0}}, {10, 0.2}).has_value());
  EXPECT_FALSE(FewestThatDo({}, {10, 0.2}).has_value());
  EXPECT_EQ(FewestThatDo({{100, 10, 0.2}}, {10, 0.2}), 100u);
}

}  // namespace
}  // namespace cairn::emit_map
