#include "core/work/work_budget.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

// So many milliseconds of it.
constexpr int64_t kMs = 1'000'000'000;
int64_t NumIn(double ms, Work work) {
  return static_cast<int64_t>(ms * static_cast<double>(kMs)) / WorkBudget::PicosecondsOf(work);
}

TEST(WorkBudget, CountsWhatWasSpentAndOnWhat) {
  WorkBudget budget(2);
  EXPECT_TRUE(budget.is_limited());
  EXPECT_EQ(budget.total_ms(), 2);
  EXPECT_TRUE(budget.Spend(Work::kSample, 3));
  EXPECT_TRUE(budget.Spend(Work::kScore, 7));
  EXPECT_EQ(budget.num(Work::kSample), 3);
  EXPECT_EQ(budget.num(Work::kScore), 7);
  EXPECT_EQ(budget.num(Work::kRefine), 0);
  const int64_t ps =
      3 * WorkBudget::PicosecondsOf(Work::kSample) + 7 * WorkBudget::PicosecondsOf(Work::kScore);
  EXPECT_EQ(budget.left_ps(), 2 * kMs - ps);
  EXPECT_DOUBLE_EQ(budget.spent_ms(), 1e-9 * static_cast<double>(ps));
}

TEST(WorkBudget, IsSpentOnceThereIsNoRoom) {
  WorkBudget budget(1);
  const int64_t all = NumIn(1, Work::kNear);
  EXPECT_TRUE(budget.Spend(Work::kNear, all)) << "just enough";
  EXPECT_FALSE(budget.is_spent());
  EXPECT_TRUE(budget.Spend(Work::kNear, 0));
  EXPECT_FALSE(budget.Spend(Work::kSample, 1));
  EXPECT_TRUE(budget.is_spent());
  EXPECT_FALSE(budget.Spend(Work::kNear, 0)) << "and stays so";
  EXPECT_LE(budget.spent_ms(), 1);
  EXPECT_EQ(budget.num(Work::kSample), 0) << "what is not done does not count";
}

TEST(WorkBudget, WithoutALimitThereIsAlwaysRoom) {
  for (WorkBudget budget : {WorkBudget(), WorkBudget(0)}) {
    EXPECT_FALSE(budget.is_limited());
    EXPECT_TRUE(budget.Spend(Work::kWholePixel, 1'000'000'000));
    EXPECT_EQ(NumAffordable(&budget, 1000, 0.1), std::numeric_limits<int64_t>::max());
    const WorkBudget::Share share(&budget, 0.1);
    EXPECT_TRUE(budget.Spend(Work::kWholePixel, 1'000'000'000));
    EXPECT_FALSE(budget.is_spent());
    budget.GiveUp();
    EXPECT_TRUE(budget.is_spent());
  }
}

TEST(WorkBudget, AShareIsAPartOfWhatIsLeft) {
  WorkBudget budget(4);
  ASSERT_TRUE(budget.Spend(Work::kNear, NumIn(2, Work::kNear)));
  {
    const WorkBudget::Share half(&budget, 0.5);
    EXPECT_NEAR(1e-9 * static_cast<double>(budget.left_ps()), 1, 1e-3);
    EXPECT_EQ(budget.total_ms(), 4);
    EXPECT_TRUE(budget.Spend(Work::kNear, NumIn(0.9, Work::kNear)));
    EXPECT_FALSE(budget.Spend(Work::kNear, NumIn(0.2, Work::kNear)));
    EXPECT_TRUE(budget.is_spent());
  }
  EXPECT_FALSE(budget.is_spent()) << "the share alone was";
  EXPECT_TRUE(budget.Spend(Work::kNear, NumIn(1, Work::kNear)));
  EXPECT_FALSE(budget.Spend(Work::kNear, NumIn(0.2, Work::kNear)));
  {
    const WorkBudget::Share share(&budget, 0.5);
    EXPECT_TRUE(budget.is_spent());
  }
  EXPECT_TRUE(budget.is_spent()) << "all of it was before";
  WorkBudget all(1);
  {
    const WorkBudget::Share share(&all, 1);
    EXPECT_FALSE(all.Spend(Work::kNear, NumIn(1.1, Work::kNear)));
  }
  EXPECT_TRUE(all.is_spent()) << "the share was all of it";
}

TEST(WorkBudget, GivingUpInAShareIsForGood) {
  WorkBudget budget(4);
  {
    const WorkBudget::Share half(&budget, 0.5);
    const WorkBudget::Share quarter(&budget, 0.5);
    EXPECT_NEAR(1e-9 * static_cast<double>(budget.left_ps()), 1, 1e-6);
    budget.GiveUp();
  }
  EXPECT_TRUE(budget.is_spent());
  EXPECT_FALSE(budget.Spend(Work::kNear, 1));
}

TEST(WorkBudget, OfNoNumberOrLessThanNothingIsNone) {
  for (const double ms : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    WorkBudget budget(ms);
    EXPECT_TRUE(budget.is_limited());
    EXPECT_FALSE(budget.Spend(Work::kNear, 1));
  }
  EXPECT_FALSE(WorkBudget(1e300).is_limited());
}

TEST(WorkBudget, SaysHowManyItIsEnoughFor) {
  const WorkBudget budget(1);
  EXPECT_EQ(NumAffordable(&budget, 1'000'000, 1), 1000);
  EXPECT_EQ(NumAffordable(&budget, 1'000'000, 0.25), 250);
  WorkBudget spent(1);
  ASSERT_TRUE(spent.Spend(Work::kNear, NumIn(1, Work::kNear)));
  EXPECT_EQ(NumAffordable(&spent, 1'000'000, 1), 0);
}

TEST(WorkBudget, NoneIsNotCounted) {
  EXPECT_TRUE(Spend(nullptr, Work::kNear, 1000));
  EXPECT_FALSE(IsSpent(nullptr));
  EXPECT_EQ(NumAffordable(nullptr, 1, 0.5), std::numeric_limits<int64_t>::max());
  const WorkBudget::Share share(nullptr, 0.5);
  WorkBudget budget(1);
  EXPECT_TRUE(Spend(&budget, Work::kNear, 5));
  EXPECT_EQ(budget.num(Work::kNear), 5);
  EXPECT_FALSE(Spend(&budget, Work::kNear, NumIn(1, Work::kNear)));
  EXPECT_TRUE(IsSpent(&budget));
}

TEST(WorkBudget, EveryPieceTakesSomething) {
  for (int k = 0; k < static_cast<int>(Work::kNum); ++k)
    EXPECT_GT(WorkBudget::PicosecondsOf(static_cast<Work>(k)), 0) << k;
}

}  // namespace
}  // namespace cairn
