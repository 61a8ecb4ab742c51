#include "core/features/approximate_search.h"

#include <algorithm>
#include <cmath>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core/utility.hpp>

#include "core/base/random.h"
#include "core/features/descriptor_distance.h"

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

// Of each kind.
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

constexpr int kFew = ApproximateIndex::kMinNumDescriptors;

TEST(ApproximateIndex, FindsMostOfManyAndNothingNearerThanTheNearest) {
  for (const Set& set : Sets(kFew)) {
    const ApproximateIndex index(set.descriptors, set.space);
    EXPECT_EQ(index.descriptors(), set.descriptors);
    DescriptorMatrix queries(set.queries.topRows(1000));
    PooledVector<BestTwo> found;
    index.FindBestTwo(queries, &found);
    PooledVector<BestTwo> exact, columns;
    FindBestTwo(queries, set.descriptors, set.space, FastestKernel(), &exact, &columns);
    ASSERT_EQ(found.size(), exact.size());
    int num_found = 0;
    for (size_t i = 0; i < found.size(); ++i) {
      EXPECT_LE(found[i].best, exact[i].best);
      EXPECT_LE(found[i].second, found[i].best);
      EXPECT_EQ(found[i].idx < 0, found[i].best < 0);
      num_found += found[i].idx == exact[i].idx;
      if (found[i].idx == exact[i].idx) {
        EXPECT_EQ(found[i].best, exact[i].best);
        EXPECT_LE(found[i].second, exact[i].second);
      }
    }
    EXPECT_GT(num_found, 850) << set.space.num_values;
  }
}

TEST(ApproximateIndex, OfEqualOnesTheFirstIsTheBest) {
  DescriptorMatrix descriptors = RandomSift(kFew, 1);
  descriptors.row(30) = descriptors.row(7);
  for (int i = 100; i < 120; ++i) descriptors.row(i) = descriptors.row(99);
  const ApproximateIndex index(descriptors, {});
  PooledVector<BestTwo> found;
  index.FindBestTwo(DescriptorMatrix(descriptors.topRows(120)), &found);
  EXPECT_EQ(found[30].idx, 7);
  EXPECT_EQ(found[7].idx, 7);
  EXPECT_EQ(found[7].second, found[7].best);
  EXPECT_EQ(found[110].second, found[110].best);
}

TEST(ApproximateIndex, ABestWithoutASecondIsNone) {
  // Bits of two halves: half of the descriptors are 0, the others 1; hashes offer those of the same half, but
  // of a query that has no other in its half.
  DescriptorMatrix bits = DescriptorMatrix::Zero(kFew, kBits.num_values);
  const int one = 2 * kBits.space().offset;
  bits.row(5).setConstant(static_cast<uint8_t>(one));
  const ApproximateIndex index(bits, kBits.space());
  PooledVector<BestTwo> found;
  index.FindBestTwo(DescriptorMatrix(bits.topRows(6)), &found);
  EXPECT_EQ(found[4].best, found[4].second);
  EXPECT_EQ(found[5].idx, -1);
  EXPECT_EQ(found[5].best, -1);
}

TEST(ApproximateIndex, TheShortestBinaryDescriptorsAreSearched) {
  const DescriptorKind kind = {.type = DescriptorType::kBinary, .num_values = kMinDescriptorDim};
  Random random(5);
  std::vector<uint8_t> bytes(size_t{kFew} * kMinDescriptorDim / 8);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random.UniformInt(0, 255));
  const DescriptorMatrix descriptors = DescriptorsFromBits(bytes.data(), kFew, kMinDescriptorDim / 8, kind);
  const ApproximateIndex index(descriptors, kind.space());
  PooledVector<BestTwo> found;
  index.FindBestTwo(descriptors, &found);
  int num_found = 0;
  for (const BestTwo& best : found)
    num_found +=
        best.best == DescriptorDot(descriptors.row(0).data(), descriptors.row(0).data(), kind.space());
  EXPECT_EQ(num_found, kFew);
}

TEST(ApproximateIndex, IsTheSameOnAnyThreadAndLeavesItsRandomNumbersAsTheyWere) {
  for (const Set& set : Sets(kFew)) {
    const DescriptorMatrix queries(set.queries.topRows(500));
    PooledVector<BestTwo> here;
    cv::theRNG() = cv::RNG(99);
    const ApproximateIndex index(set.descriptors, set.space);
    index.FindBestTwo(queries, &here);
    const unsigned next = cv::theRNG().next();
    cv::theRNG() = cv::RNG(99);
    EXPECT_EQ(cv::theRNG().next(), next);
    const auto expect_same = [&](const ApproximateIndex& searched) {
      PooledVector<BestTwo> there;
      searched.FindBestTwo(queries, &there);
      for (size_t i = 0; i < here.size(); ++i) {
        EXPECT_EQ(here[i].idx, there[i].idx);
        EXPECT_EQ(here[i].second, there[i].second);
      }
    };
    // One that is made with other random numbers before, and one that several share.
    std::vector<std::thread> threads;
    threads.emplace_back([&] {
      cv::theRNG() = cv::RNG(12345);
      expect_same(ApproximateIndex(set.descriptors, set.space));
    });
    for (int i = 0; i < 3; ++i) threads.emplace_back([&] { expect_same(index); });
    for (std::thread& thread : threads) thread.join();
  }
}

TEST(ApproximateIndex, TakesWhatItSays) {
  const int64_t num = 100000;
  EXPECT_EQ(ApproximateIndex::NumBytes(num, {}), num * (128 + 4 * 64));
  const DescriptorSpace bits = kBits.space();
  const int64_t few = num * (256 + 32 + 12 * 90) + 12 * (1 << 17);
  EXPECT_EQ(ApproximateIndex::NumBytes(num, bits), few);
  EXPECT_GT(ApproximateIndex::NumBytes(1 << 20, bits), few + (int64_t{300} << 20));
}

TEST(MatchApproximately, MatchesMostAndAsTheExactSearch) {
  const Set set = std::move(Sets(kFew).front());
  const DescriptorMatrix queries = set.queries;
  const PooledVector<Match> found = MatchApproximately(ApproximateIndex(queries, set.space),
                                                       ApproximateIndex(set.descriptors, set.space), {});
  const PooledVector<Match> exact = MatchDescriptors(queries, set.descriptors, set.space, {});
  EXPECT_GT(exact.size(), 0.8 * kFew);
  EXPECT_GT(found.size(), 0.8 * static_cast<double>(exact.size()));
  EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
  int num_right = 0;
  for (const Match& match : found) num_right += match.idx1 == match.idx2;
  EXPECT_GT(num_right, 0.99 * static_cast<double>(found.size()));
}

TEST(IsApproximateFaster, FromSomeHundredThousandOfBothOn) {
  EXPECT_FALSE(IsApproximateFaster(8000, 8000, {}));
  EXPECT_FALSE(IsApproximateFaster(600000, 600000, {}));
  EXPECT_TRUE(IsApproximateFaster(600001, 600001, {}));
  EXPECT_FALSE(IsApproximateFaster(300000, 1000000000, {}));
  EXPECT_TRUE(IsApproximateFaster(1000000000, 300200, {}));
  EXPECT_TRUE(IsApproximateFaster(1000000, 1000000, kFloats.space()));
  EXPECT_FALSE(IsApproximateFaster(1000000, 1000000, kBits.space()));
}

}  // namespace
}  // namespace cairn
