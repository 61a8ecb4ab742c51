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
}

}  // namespace
}  // namespace cairn
