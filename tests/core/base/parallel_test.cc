#include "core/base/parallel.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::Each;

TEST(Parallel, EveryItemIsDoneOnce) {
  for (const int num_threads : {1, 2, 5}) {
    for (const int64_t num_items : {0, 1, 3, 100}) {
      std::vector<int> num_done(num_items, 0);
      ParallelFor(num_items, num_threads, [&](int64_t i) { ++num_done[i]; });
      EXPECT_THAT(num_done, Each(1)) << num_items;
    }
  }
}

TEST(Parallel, RunsHaveEveryItemOnceAndNoMoreThanTheirLength) {
  for (const int num_threads : {1, 3}) {
    for (const int64_t num_items : {0, 1, 6, 7, 8}) {
      for (const int64_t run_length : {1, 3, 7, 100}) {
        std::vector<int> num_done(num_items, 0);
        std::atomic<int> num_runs = 0;
        ParallelForRuns(num_items, run_length, num_threads, [&](int64_t begin, int64_t end) {
          EXPECT_LE(end - begin, run_length);
          EXPECT_EQ(begin % run_length, 0);
          for (int64_t i = begin; i < end; ++i) ++num_done[i];
          ++num_runs;
        });
        EXPECT_THAT(num_done, Each(1));
        EXPECT_EQ(num_runs, (num_items + run_length - 1) / run_length);
      }
    }
  }
}

TEST(Parallel, AnExceptionIsThrownWhereItWasCalled) {
  for (const int num_threads : {1, 3}) {
    EXPECT_THROW(ParallelFor(10, num_threads,
                             [](int64_t i) {
                               if (i == 4) throw std::runtime_error("four");
                             }),
                 std::runtime_error);
  }
}

TEST(Parallel, SoManyThreadsAreAtWorkAsWasSaidAndNoMoreThanItems) {
  EXPECT_EQ(NumThreads(7), 7);
  EXPECT_EQ(NumThreads(1), 1);
  EXPECT_GE(NumThreads(0), 1);
  EXPECT_EQ(NumThreads(-3), NumThreads(0));
  cpu_set_t allowed;
  ASSERT_EQ(sched_getaffinity(0, sizeof(allowed), &allowed), 0);
  EXPECT_EQ(NumThreads(0), CPU_COUNT(&allowed));
  // Each item waits until all threads have one; not for ever.
  for (const int num_threads : {1, 2, 4}) {
    for (const int num_items : {4, 2}) {
      const int expected = std::min(num_threads, num_items);
      std::mutex mutex;
      std::set<std::thread::id> threads;
      std::atomic<int> num_at_work = 0;
      ParallelFor(num_items, num_threads, [&](int64_t) {
        {
          const std::lock_guard<std::mutex> lock(mutex);
          if (threads.insert(std::this_thread::get_id()).second) ++num_at_work;
        }
        for (int i = 0; i < 2000 && num_at_work < expected; ++i)
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
      });
      EXPECT_EQ(std::ssize(threads), expected);
      EXPECT_TRUE(threads.contains(std::this_thread::get_id()));
    }
  }
}

TEST(Parallel, AfterAnExceptionNoItemIsBegun) {
  std::atomic<int> num_begun = 0;
  EXPECT_THROW(ParallelFor(1000, 2,
                           [&](int64_t) {
                             ++num_begun;
                             throw std::runtime_error("each");
                           }),
               std::runtime_error);
  EXPECT_LE(num_begun, 2);
}

}  // namespace
}  // namespace cairn
