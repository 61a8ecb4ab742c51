#include "core/base/pooled.h"

#include <malloc.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <set>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

constexpr size_t kMib = size_t{1} << 20;

// An object of a thread that uses the pool while the thread ends.
struct EndsLate {
  PooledVector<int> values;
  ~EndsLate() {
    values.assign(10000, 1);
    values = {};
    GivePooled(TakePooled(10000));
  }
};

// In a thread of its own, which keeps nothing yet.
template <typename Test>
void InNewThread(const Test& test) {
  std::thread(test).join();
}

TEST(Pooled, MemoryIsAlignedAndAsLargeAsAsked) {
  for (const size_t num_bytes :
       {size_t{0}, size_t{1}, size_t{63}, size_t{64}, size_t{65}, size_t{72}, size_t{73}, size_t{127},
        size_t{128}, size_t{129}, size_t{1000}, size_t{4097}, kMib - 1, kMib, kMib + 1, 8 * kMib - 1,
        8 * kMib, 8 * kMib + 1, 9 * kMib}) {
    void* const memory = TakePooled(num_bytes);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(memory) % 64, 0u) << num_bytes;
    std::memset(memory, 0x5a, num_bytes);  // a sanitizer sees what is too much
    GivePooled(memory);
  }
}

TEST(Pooled, SizesAreAnEighthApart) {
  EXPECT_EQ(PooledSize(0), 128u);
  EXPECT_EQ(PooledSize(64), 128u);
  EXPECT_EQ(PooledSize(65), 64 + 72u);
  EXPECT_EQ(PooledSize(72), 64 + 72u);
  EXPECT_EQ(PooledSize(73), 64 + 80u);
  EXPECT_EQ(PooledSize(120), 64 + 120u);
  EXPECT_EQ(PooledSize(121), 64 + 128u);
  EXPECT_EQ(PooledSize(129), 64 + 144u);
  EXPECT_EQ(PooledSize(8 * kMib - 1), 64 + 8 * kMib);
  EXPECT_EQ(PooledSize(8 * kMib), 64 + 8 * kMib);
  EXPECT_EQ(PooledSize(8 * kMib + 1), 64 + 8 * kMib + 1);
  for (size_t num_bytes = 1; num_bytes < 9 * kMib; num_bytes = num_bytes * 9 / 8 + 1) {
    EXPECT_GE(PooledSize(num_bytes), num_bytes + 64) << num_bytes;
    EXPECT_LE(PooledSize(num_bytes), std::max<size_t>(64, num_bytes * 9 / 8) + 64 + 8) << num_bytes;
  }
}

TEST(Pooled, WhatIsGivenBackIsTakenNext) {
  if (!KeepsPooled()) GTEST_SKIP();
  InNewThread([] {
    for (const size_t num_bytes :
         {size_t{1}, size_t{64}, size_t{100}, size_t{1000}, size_t{4097}, 8 * kMib}) {
      void* const first = TakePooled(num_bytes);
      GivePooled(first);
      void* const second = TakePooled(num_bytes);
      EXPECT_EQ(first, second) << num_bytes;
      GivePooled(second);
    }
  });
}

TEST(Pooled, ALargerBlockWillDoButNotOneOfMoreThanTwice) {
  if (!KeepsPooled()) GTEST_SKIP();
  InNewThread([] {
    void* const large = TakePooled(2048);
    GivePooled(large);
    void* const much_less = TakePooled(960);  // of the size below half of it
    EXPECT_NE(much_less, large);
    void* const half = TakePooled(1024);
    EXPECT_EQ(half, large);
    // It is still as large as it was.
    GivePooled(half);
    void* const all = TakePooled(2048);
    EXPECT_EQ(all, large);
    GivePooled(all);
    GivePooled(much_less);
  });
}

TEST(Pooled, BlocksInUseAreDifferent) {
  std::set<void*> blocks;
  for (int round = 0; round < 2; ++round) {
    blocks.clear();
    for (size_t i = 0; i < 300; ++i) blocks.insert(TakePooled(37 * i));
    EXPECT_EQ(blocks.size(), 300u);
    for (void* block : blocks) GivePooled(block);
  }
}

// Blocks of which so many are kept that more go back to the system: of those taken next as many are old.
TEST(Pooled, NoMoreThan16MibAreKept) {
  if (!KeepsPooled()) GTEST_SKIP();
  InNewThread([] {
    std::vector<void*> taken;
    for (int i = 0; i < 24; ++i) taken.push_back(TakePooled(kMib));
    void* const huge = TakePooled(8 * kMib);
    for (void* block : taken) GivePooled(block);
    GivePooled(huge);  // there is no room for it any more
    // The last that was kept comes first.
    for (int i = 15; i-- > 0;) EXPECT_EQ(TakePooled(kMib), taken[i]) << i;  // and 64 bytes each
    for (int i = 0; i < 15; ++i) GivePooled(taken[i]);
  });
}

TEST(Pooled, WhatIsTakenAgainIsNoLongerCounted) {
  if (!KeepsPooled()) GTEST_SKIP();
  InNewThread([] {
    void* const first = TakePooled(kMib);
    GivePooled(first);
    for (int i = 0; i < 40; ++i) {
      ASSERT_EQ(TakePooled(kMib), first) << i;
      GivePooled(first);
    }
  });
}

TEST(Pooled, LargerBlocksMakeRoomForSmallOnes) {
  if (!KeepsPooled()) GTEST_SKIP();
  InNewThread([] {
    std::vector<void*> taken;
    for (int i = 0; i < 16; ++i) taken.push_back(TakePooled(kMib));
    for (void* block : taken) GivePooled(block);  // now it is full
    std::vector<void*> small;
    for (int i = 0; i < 3000; ++i) small.push_back(TakePooled(1000));
    for (void* block : small) GivePooled(block);
    // Nobody else may get them meanwhile.
    std::vector<std::unique_ptr<char[]>> others;
    for (int i = 0; i < 3000; ++i) others.push_back(std::make_unique<char[]>(1000));
    for (int i = 3000; i-- > 0;) ASSERT_EQ(TakePooled(1000), small[i]) << i;
    for (void* block : small) GivePooled(block);
  });
}

TEST(Pooled, TheLargestAreNotKept) {
  if (!KeepsPooled()) GTEST_SKIP();
  InNewThread([] {
    GivePooled(TakePooled(8 * kMib + 1));
    GivePooled(TakePooled(100 * kMib));
    void* const small = TakePooled(1000);
    GivePooled(small);
    EXPECT_EQ(TakePooled(1000), small);
    GivePooled(small);
  });
}

TEST(Pooled, AThreadThatEndsGivesAllBack) {
  if (!KeepsPooled()) GTEST_SKIP();
  const auto num_in_use = [] {
    const struct mallinfo2 info = mallinfo2();
    return info.uordblks + info.hblkhd;
  };
  const auto work = [] {
    thread_local EndsLate late;
    late.values.assign(100, 3);
    EXPECT_EQ(late.values[99], 3);
    std::vector<void*> taken;
    for (size_t i = 0; i < 64; ++i) taken.push_back(TakePooled(i * 10000));
    for (int i = 0; i < 24; ++i) taken.push_back(TakePooled(kMib));
    for (void* block : taken) GivePooled(block);
  };
  InNewThread(work);  // what the C library keeps of a first thread
  const size_t before = num_in_use();
  for (int i = 0; i < 3; ++i) InNewThread(work);
  EXPECT_LT(num_in_use(), before + 4096);
}

TEST(Pooled, AnotherThreadMayGiveItBack) {
  void* memory = nullptr;
  InNewThread([&] { memory = TakePooled(1000); });
  if (KeepsPooled()) {
    InNewThread([&] {
      GivePooled(memory);
      EXPECT_EQ(TakePooled(1000), memory);
      GivePooled(memory);
    });
  } else {
    GivePooled(memory);
  }
}

TEST(Pooled, VectorsGrow) {
  PooledVector<int64_t> values;
  for (int64_t i = 0; i < 100000; ++i) values.push_back(i);
  for (int64_t i = 0; i < 100000; ++i) ASSERT_EQ(values[i], i);
  PooledVector<int64_t> other = values;
  EXPECT_EQ(other, values);
  const int64_t* const data = other.data();
  values = std::move(other);
  EXPECT_EQ(values.data(), data);
}

}  // namespace
}  // namespace cairn
