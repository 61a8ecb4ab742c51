#include "core/threads/of_thread.h"

#include <atomic>
#include <thread>

#include <gtest/gtest.h>

namespace cairn {
namespace {

std::atomic<int> num_made = 0, num_destroyed = 0;

struct Counted {
  Counted() noexcept { ++num_made; }
  ~Counted() { ++num_destroyed; }
  int value = 0;
};

TEST(OfThread, IsOneForEachThreadAndGoesWithIt) {
  num_made = num_destroyed = 0;
  Counted* const mine = OfThread<Counted>();
  ASSERT_NE(mine, nullptr);
  mine->value = 1;
  std::thread([&] {
    Counted& other = RequiredOfThread<Counted>();
    EXPECT_NE(&other, mine);
    other.value = 2;
    EXPECT_EQ(OfThread<Counted>(), &other);
    EXPECT_EQ(num_destroyed, 0);
  }).join();
  EXPECT_EQ(num_made, 2);
  EXPECT_EQ(num_destroyed, 1);
  EXPECT_EQ(OfThread<Counted>(), mine);
  EXPECT_EQ(mine->value, 1);
}

// Asks for what may be gone, as memory is given back.
struct Late {
  ~Late() { OfThread<Counted>()->value = 3; }
};

TEST(OfThread, WhatIsAskedForWhileTheThreadEndsGoesToo) {
  num_made = num_destroyed = 0;
  std::thread([] {
    OfThread<Late>();
    OfThread<Counted>();
    thread_local const Late late;
    (void)late;
  }).join();
  EXPECT_GE(num_made, 1);
  EXPECT_EQ(num_destroyed, num_made);
}

}  // namespace
}  // namespace cairn
