#include "stages/match_features/pairs/spilled_array.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::match_features {
namespace {

using testing::HasSubstr;

// Parts of 1, 2, ... 20 numbers, with where each begins.
struct Part {
  uint64_t begin;
  std::vector<int> values;
};

std::vector<Part> AddParts(SpilledArray<int>* array) {
  std::vector<Part> parts;
  for (int num = 1, next = 0; num <= 20; ++num) {
    Part part{array->size(), {}};
    for (int i = 0; i < num; ++i) part.values.push_back(next++);
    array->Append(part.values);
    parts.push_back(part);
  }
  return parts;
}

TEST(SpilledArray, PartsAreReadAsTheyWereAddedWhateverMemoryHas) {
  for (const int64_t max_num_bytes : {0, 4, 7 * 4, 100, 1 << 20}) {
    SpilledArray<int> array(testing::TempDir() + "/array", max_num_bytes);
    for (const Part& part : AddParts(&array)) {
      std::vector<int> values(part.values.size());
      ASSERT_TRUE(array.Read(part.begin, values).ok());
      EXPECT_EQ(values, part.values) << max_num_bytes;
    }
    EXPECT_EQ(array.size(), 210u);
    EXPECT_TRUE(array.status().ok());
  }
}

TEST(SpilledArray, ReadsWhileMoreIsAdded) {
  SpilledArray<int> array(testing::TempDir() + "/array", 3 * sizeof(int));
  for (int i = 0; i < 20; ++i) {
    array.Append(std::vector<int>{i, -i});
    for (int k = 0; k <= i; ++k) {
      std::vector<int> values(2);
      ASSERT_TRUE(array.Read(2 * k, values).ok());
      EXPECT_THAT(values, testing::ElementsAre(k, -k));
    }
  }
}

TEST(SpilledArray, MemoryThatIsEnoughNeedsNoFile) {
  SpilledArray<int> array("/nowhere/array", 3 * sizeof(int));
  array.Append(std::vector<int>{1, 2, 3});
  EXPECT_TRUE(array.status().ok());
  array.Append(std::vector<int>{4});
  ASSERT_FALSE(array.status().ok());
  EXPECT_THAT(array.status().error().message, HasSubstr("/nowhere/array"));
  EXPECT_EQ(array.size(), 4u);
}

TEST(SpilledArray, TheFirstErrorStays) {
  SpilledArray<int> array("/nowhere/array", 0);
  for (int i = 0; i < 3; ++i) array.Append(std::vector<int>{i});
  EXPECT_FALSE(array.status().ok());
}

}  // namespace
}  // namespace cairn::match_features
