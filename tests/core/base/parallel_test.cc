#include "core/base/parallel.h"

#include <atomic>
#include <stdexcept>
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

}  // namespace
}  // namespace cairn
