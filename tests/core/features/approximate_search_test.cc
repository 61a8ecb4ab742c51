#include "core/features/approximate_search.h"

#include <cmath>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core/utility.hpp>

#include "core/base/random.h"

namespace cairn {
namespace {

const DescriptorKind kFloats = {.type = DescriptorType::kFloat, .num_values = 64};
const DescriptorKind kBits = {.type = DescriptorType::kBinary, .num_values = 256};

DescriptorMatrix RandomSift(int num, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(num, kSiftDescriptorDim);
  for (int i = 0; i < num; ++i) {
    Eigen::Matrix<double, 1, kSiftDescriptorDim> values;
    for (int k = 0; k < kSiftDescriptorDim; ++k) values[k] = std::pow(random.Uniform(), 4);
    descriptors.row(i) = (values * 512 / values.norm()).array().min(255.0).round().cast<uint8_t>();
  }
  return descriptors;
}

DescriptorMatrix RandomFloats(int num, uint64_t seed) {
  Random random(seed);
  FloatDescriptors values(num, kFloats.num_values);
  for (Eigen::Index i = 0; i < values.size(); ++i) values.data()[i] = static_cast<float>(random.Normal(0, 1));
  return *DescriptorsFromFloats(values, kFloats);
}

DescriptorMatrix RandomBits(int num, uint64_t seed) {
  Random random(seed);
  std::vector<uint8_t> bytes(static_cast<size_t>(num) * kBits.num_values / 8);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random.UniformInt(0, 255));
  return DescriptorsFromBits(bytes.data(), num, kBits.num_values / 8, kBits);
}

// Each as another view has it: a part of its values are another's.
DescriptorMatrix SeenAgain(const DescriptorMatrix& descriptors, int every, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix again(descriptors);
  for (Eigen::Index i = 0; i < again.rows(); ++i) {
    for (Eigen::Index k = static_cast<Eigen::Index>(random.UniformInt(0, every - 1)); k < again.cols();
         k += every)
      again(i, k) = descriptors(random.UniformInt(0, descriptors.rows() - 1), k);
  }
  return again;
}

struct Set {
  DescriptorSpace space;
  DescriptorMatrix descriptors, queries;
};

std::vector<Set> Sets(int num) {
  std::vector<Set> sets = {{{}, RandomSift(num, 1), {}},
                           {kFloats.space(), RandomFloats(num, 2), {}},
                           {kBits.space(), RandomBits(num, 3), {}}};
  for (Set& set : sets) set.queries = SeenAgain(set.descriptors, 10, 4);
  return sets;
}

PooledVector<BestTwo> Exact(const Set& set) {
  PooledVector<BestTwo> rows, columns;
  FindBestTwo(set.queries, set.descriptors, set.space, FastestKernel(), &rows, &columns);
  return rows;
}

TEST(ApproximateIndex, FindsMostOfManyAndNothingNearerThanTheNearest) {
  for (const Set& set : Sets(3000)) {
    const ApproximateIndex index(set.descriptors, set.space);
    PooledVector<BestTwo> found;
    index.FindBestTwo(set.queries, &found);
    const PooledVector<BestTwo> exact = Exact(set);
    ASSERT_EQ(found.size(), exact.size());
    int num_found = 0;
    for (size_t i = 0; i < found.size(); ++i) {
      EXPECT_LE(found[i].best, exact[i].best);
      EXPECT_LE(found[i].second, found[i].best);
      num_found += found[i].idx == exact[i].idx;
      if (found[i].idx == exact[i].idx) {
        EXPECT_EQ(found[i].best, exact[i].best);
        EXPECT_LE(found[i].second, exact[i].second);
      }
    }
    EXPECT_GT(num_found, 2700) << set.space.num_values;
  }
}

TEST(ApproximateIndex, FindsAllOfFew) {
  for (const int num : {1, 2, 3, 4, 5, 100}) {
    for (const Set& set : Sets(num)) {
      if (set.space.measure == DescriptorMeasure::kHamming)
        continue;  // those of no hash in common are not found
      const ApproximateIndex index(set.descriptors, set.space);
      PooledVector<BestTwo> found;
      index.FindBestTwo(set.queries, &found);
      const PooledVector<BestTwo> exact = Exact(set);
      for (size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].idx, exact[i].idx) << num;
        EXPECT_EQ(found[i].best, exact[i].best);
        EXPECT_EQ(found[i].second, exact[i].second) << num;
      }
    }
  }
}

TEST(ApproximateIndex, OfEqualOnesTheFirstIsTheBest) {
  DescriptorMatrix descriptors = RandomSift(50, 1);
  descriptors.row(30) = descriptors.row(7);
  const ApproximateIndex index(descriptors, {});
  PooledVector<BestTwo> found;
  index.FindBestTwo(descriptors, &found);
  EXPECT_EQ(found[30].idx, 7);
  EXPECT_EQ(found[7].idx, 7);
  EXPECT_EQ(found[7].second, found[7].best);
}

TEST(ApproximateIndex, IsTheSameOnAnyThreadAndLeavesItsRandomNumbersAsTheyWere) {
  for (const Set& set : Sets(2000)) {
    PooledVector<BestTwo> here, there;
    cv::theRNG() = cv::RNG(99);
    ApproximateIndex(set.descriptors, set.space).FindBestTwo(set.queries, &here);
    const unsigned next = cv::theRNG().next();
    cv::theRNG() = cv::RNG(99);
    EXPECT_EQ(cv::theRNG().next(), next);
    std::thread([&] {
      cv::theRNG() = cv::RNG(12345);
      ApproximateIndex(set.descriptors, set.space).FindBestTwo(set.queries, &there);
    }).join();
    for (size_t i = 0; i < here.size(); ++i) {
      EXPECT_EQ(here[i].idx, there[i].idx);
      EXPECT_EQ(here[i].second, there[i].second);
    }
  }
}

TEST(MatchApproximately, MatchesFewAsExactlyAsAll) {
  for (const Set& set : Sets(100)) {
    const PooledVector<Match> found = MatchApproximately(ApproximateIndex(set.queries, set.space),
                                                         ApproximateIndex(set.descriptors, set.space), {});
    const PooledVector<Match> exact = MatchDescriptors(set.queries, set.descriptors, set.space, {});
    EXPECT_GT(exact.size(), 80u);
    if (set.space.measure == DescriptorMeasure::kHamming) {
      EXPECT_GT(found.size(), 0.9 * static_cast<double>(exact.size()));
      for (const Match& match : found) EXPECT_EQ(match.idx1, match.idx2);
    } else {
      EXPECT_EQ(found, exact);
    }
  }
}

TEST(IsApproximateFaster, FromSomeHundredThousandOfBothOn) {
  EXPECT_FALSE(IsApproximateFaster(8000, 8000, {}));
  EXPECT_FALSE(IsApproximateFaster(400000, 400000, {}));
  EXPECT_TRUE(IsApproximateFaster(400001, 400001, {}));
  EXPECT_FALSE(IsApproximateFaster(200000, 1000000000, {}));
  EXPECT_TRUE(IsApproximateFaster(1000000000, 200100, {}));
  EXPECT_TRUE(IsApproximateFaster(1000000, 1000000, kFloats.space()));
  EXPECT_FALSE(IsApproximateFaster(1000000, 1000000, kBits.space()));
}

}  // namespace
}  // namespace cairn
