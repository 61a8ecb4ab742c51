#include "core/base/quantiles.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(Quantiles, OddNumbersOfValuesHaveOneMedian) {
  const std::vector<double> values = {5, 1, 4, 2, 3};
  EXPECT_EQ(Median(values), 3);
  EXPECT_EQ(UpperMedian(values), 3);
  EXPECT_EQ(Quantile(values, 0.5), 3);
  EXPECT_EQ(Median({7}), 7);
  EXPECT_EQ(UpperMedian({7}), 7);
  EXPECT_EQ(Quantile({7}, 0.5), 7);
}

TEST(Quantiles, EvenNumbersOfValuesHaveALowerAMiddleAndAnUpperOne) {
  const std::vector<double> values = {10, 40, 20, 80};
  EXPECT_EQ(Quantile(values, 0.5), 20);
  EXPECT_EQ(Median(values), 30);
  EXPECT_EQ(UpperMedian(values), 40);
}

TEST(Quantiles, QuantileIsTheNearestRankAndDecileTheValueThatSoManyTenthsLieBelow) {
  const std::vector<double> values = {9, 8, 7, 6, 5, 4, 3, 2, 1, 0};
  EXPECT_EQ(Quantile(values, 0), 0);
  EXPECT_EQ(Quantile(values, 0.1), 0);
  EXPECT_EQ(Quantile(values, 0.11), 1);
  EXPECT_EQ(Quantile(values, 0.9), 8);
  EXPECT_EQ(Quantile(values, 1), 9);
  for (int tenths = 0; tenths < 10; ++tenths) EXPECT_EQ(Decile(values, tenths), tenths);
  EXPECT_EQ(Decile({1, 2, 3}, 9), 3);
}

}  // namespace
}  // namespace cairn
