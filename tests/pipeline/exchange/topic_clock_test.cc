#include "pipeline/exchange/bags/topic_clock.h"

#include <limits>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr int64_t kMs = 1'000'000, kS = 1'000 * kMs;

// Of messages that were recorded each 0.1 s from a time on, with stamps as far ahead of that.
TopicClock Clock(int64_t begin_ns, const std::vector<int64_t>& aheads_ns) {
  TopicClock clock;
  for (size_t i = 0; i < aheads_ns.size(); ++i) {
    const int64_t recorded_ns = begin_ns + static_cast<int64_t>(i) * 100 * kMs;
    clock.Add(recorded_ns + aheads_ns[i], recorded_ns);
  }
  clock.Finish();
  return clock;
}

TEST(TopicClock, OfAnotherClockIsShiftedByWhatBothAreAheadOfTheRecording) {
  const TopicClock images = Clock(100 * kS, {70 * kS, 70 * kS + kMs, 70 * kS + 2 * kMs});
  const TopicClock wheels = Clock(100 * kS, {-20 * kS, -20 * kS, 3 * kS});
  EXPECT_EQ(ShiftToClock(images, wheels), 90 * kS + kMs);
  EXPECT_EQ(ShiftToClock(wheels, images), -90 * kS - kMs);
  EXPECT_EQ(ShiftToClock(images, images), 0);
}

TEST(TopicClock, IsTheSameUpToFiveSeconds) {
  const TopicClock images = Clock(100 * kS, {0, 0, 0});
  EXPECT_EQ(ShiftToClock(images, Clock(100 * kS, std::vector<int64_t>(3, 5 * kS - 1))), 0);
  EXPECT_EQ(ShiftToClock(images, Clock(100 * kS, std::vector<int64_t>(3, 5 * kS))), -5 * kS);
}

TEST(TopicClock, IsNotShiftedWhereTimesOfRecordingSayNothing) {
  const TopicClock images = Clock(100 * kS, {0, 0, 0});
  // Stamps that run at another rate than the recording, by up to and more than 0.2 s on the median.
  EXPECT_EQ(ShiftToClock(images, Clock(100 * kS, {50 * kS - 200 * kMs, 50 * kS, 50 * kS + 200 * kMs})),
            -50 * kS);
  EXPECT_EQ(ShiftToClock(images, Clock(100 * kS, {50 * kS - 201 * kMs, 50 * kS, 50 * kS + 201 * kMs})), 0);
  // Recorded one after the other.
  EXPECT_EQ(ShiftToClock(images, Clock(100 * kS + 200 * kMs, {50 * kS})), -50 * kS);
  EXPECT_EQ(ShiftToClock(images, Clock(100 * kS + 201 * kMs, {50 * kS})), 0);
}

TEST(TopicClock, WithoutStampsIsThatOfTheRecording) {
  TopicClock unstamped;
  unstamped.Add(0, 100 * kS);
  unstamped.Finish();
  EXPECT_EQ(unstamped.TimeOf(0, 101 * kS), 101 * kS);
  EXPECT_EQ(ShiftToClock(Clock(100 * kS, {70 * kS}), unstamped), 70 * kS);
}

TEST(SourceTimes, MendsShiftsAndCounts) {
  SourceTimes times(Clock(100 * kS, {7 * kS, 7 * kS, 7 * kS}), 1000 * kS);
  EXPECT_FALSE(times.has_taken());
  EXPECT_EQ(times.Take(108 * kS, 101 * kS), 1108 * kS);
  EXPECT_TRUE(times.has_taken());
  EXPECT_THAT(times.Warnings("images"), ElementsAre());
  EXPECT_EQ(times.Take(0, 102 * kS), 1109 * kS);
  EXPECT_EQ(times.Take(4'200'000'000 * kS, 103 * kS), 1110 * kS);
  EXPECT_EQ(times.Take(5, 104 * kS), 1111 * kS);
  EXPECT_THAT(times.Warnings("images"),
              ElementsAre(HasSubstr("1 images have no stamp"),
                          HasSubstr("2 images have stamps far from when they were recorded, unlike the "
                                    "others (the first: 4200000000.000 s)")));
}

// Times as they stand in damaged messages.
TEST(SourceTimes, DoNotOverflow) {
  constexpr int64_t kMost = std::numeric_limits<int64_t>::max(), kLeast = std::numeric_limits<int64_t>::min();
  SourceTimes late(TopicClock(), kMost), early(TopicClock(), kLeast);
  EXPECT_EQ(late.Take(kMost, kMost), kMost);
  EXPECT_EQ(early.Take(kLeast, kLeast), kLeast);
}

TEST(TimeSpan, MeetsWhatSharesATimeWithIt) {
  TimeSpan span, other;
  EXPECT_FALSE(span.Meets(other));
  span.Add(3 * kS);
  span.Add(1 * kS);
  EXPECT_FALSE(span.Meets(other));
  other.Add(3 * kS);
  other.Add(5 * kS);
  EXPECT_TRUE(span.Meets(other));
  EXPECT_TRUE(other.Meets(span));
  EXPECT_EQ(span.Text(), "1.000 to 3.000 s");
  TimeSpan later;
  later.Add(3 * kS + 1);
  EXPECT_FALSE(span.Meets(later));
  EXPECT_FALSE(later.Meets(span));
}

}  // namespace
}  // namespace cairn::pipeline
