#include "core/features/descriptor_matcher.h"

#include <gtest/gtest.h>
#include <span>

#include "core/base/pooled.h"
#include "core/base/random.h"

namespace cairn {
namespace {

DescriptorMatrix RandomDescriptors(int num, int max_value, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(num, kSiftDescriptorDim);
  for (int i = 0; i < num; ++i) {
    for (int d = 0; d < kSiftDescriptorDim; ++d)
      descriptors(i, d) = static_cast<uint8_t>(random.UniformInt(0, max_value));
  }
  return descriptors;
}

DescriptorMatrix RandomDescriptorsOf(const DescriptorSpace& space, int num, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(num, space.num_values);
  for (Eigen::Index i = 0; i < descriptors.size(); ++i)
    descriptors.data()[i] = static_cast<uint8_t>(random.UniformInt(0, 255));
  return descriptors;
}

// The definition, without any cleverness.  About an offset, what is at a right angle or more does not count.
PooledVector<BestTwo> OracleRows(const DescriptorMatrix& descriptors1, const DescriptorMatrix& descriptors2,
                                 int offset = 0) {
  PooledVector<BestTwo> rows(descriptors1.rows());
  for (int i = 0; i < descriptors1.rows(); ++i) {
    for (int j = 0; j < descriptors2.rows(); ++j) {
      const int dot = (descriptors1.row(i).cast<int>().array() - offset)
                          .matrix()
                          .dot((descriptors2.row(j).cast<int>().array() - offset).matrix());
      if (offset > 0 && dot <= 0) continue;
      if (dot > rows[i].best) {
        rows[i] = {j, dot, rows[i].best};
      } else {
        rows[i].second = std::max(rows[i].second, dot);
      }
    }
  }
  return rows;
}

void ExpectEqual(std::span<const BestTwo> found, std::span<const BestTwo> expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].idx, expected[i].idx) << i;
    EXPECT_EQ(found[i].best, expected[i].best) << i;
    EXPECT_EQ(found[i].second, expected[i].second) << i;
  }
}

// With emulated instructions (tests/core/features/emulated) every kernel of x86-64 runs.
bool Runs(MatchKernel kernel) {
#ifdef CAIRN_EMULATED_INTRINSICS
  return kernel != MatchKernel::kNeonDot;
#else
  return IsKernelSupported(kernel);
#endif
}

class FindBestTwoTest : public testing::TestWithParam<MatchKernel> {
 protected:
  void SetUp() override {
    if (!Runs(GetParam())) GTEST_SKIP() << "this processor lacks the instructions";
  }
};

TEST_P(FindBestTwoTest, EqualsBruteForceForAnySizeTiesIncluded) {
  for (const int num1 : {0, 1, 2, 7, 8, 9, 100, 257}) {
    for (const int num2 : {0, 1, 15, 16, 17, 33, 300}) {
      for (const int max_value :
           {1, 255}) {  // values of 0 and 1 only: ties everywhere; 255: the largest products
        const DescriptorMatrix d1 = RandomDescriptors(num1, max_value, 1 + num1);
        const DescriptorMatrix d2 = RandomDescriptors(num2, max_value, 1000 + num2);
        PooledVector<BestTwo> rows, columns;
        FindBestTwo(d1, d2, {}, GetParam(), &rows, &columns);
        ExpectEqual(rows, OracleRows(d1, d2));
        ExpectEqual(columns, OracleRows(d2, d1));
      }
    }
  }
}

TEST_P(FindBestTwoTest, SaturatedAndZeroDescriptorsDoNotOverflow) {
  DescriptorMatrix d1 = DescriptorMatrix::Constant(9, kSiftDescriptorDim, 255);
  DescriptorMatrix d2 = DescriptorMatrix::Constant(40, kSiftDescriptorDim, 255);
  d1.row(3).setZero();
  d2.row(5).setZero();
  PooledVector<BestTwo> rows, columns;
  FindBestTwo(d1, d2, {}, GetParam(), &rows, &columns);
  ExpectEqual(rows, OracleRows(d1, d2));
  ExpectEqual(columns, OracleRows(d2, d1));
}

// Descriptors for the 16-bit kernels and others, mixed, with equal ones among both.
TEST_P(FindBestTwoTest, SmallAndLargeValuesMixedFindTheSame) {
  DescriptorMatrix d1 = RandomDescriptors(300, 60, 1), d2 = RandomDescriptors(200, 90, 2);
  for (int i = 0; i < 300; i += 7) d1.row(i).head(3).setConstant(255);
  for (int i = 0; i < 200; i += 5) d2.row(i).head(2).setConstant(200);
  d2.row(6) = d2.row(60);
  d2.row(5) = d2.row(50);
  d1.bottomRows(40) = d1.topRows(40);
  PooledVector<BestTwo> rows, columns;
  FindBestTwo(d1, d2, {}, GetParam(), &rows, &columns);
  ExpectEqual(rows, OracleRows(d1, d2));
  ExpectEqual(columns, OracleRows(d2, d1));
}

// The largest sums that the 16-bit kernels take: the whole norm in one of their lanes, pairs up to 181.
TEST_P(FindBestTwoTest, ConcentratedDescriptorsDoNotOverflow) {
  DescriptorMatrix d1 = DescriptorMatrix::Zero(128 + 120, kSiftDescriptorDim);
  for (int i = 0; i < 128; ++i) d1(i, i) = static_cast<uint8_t>(120 + i);
  for (int i = 128; i < d1.rows(); ++i) d1.row(i).setConstant(static_cast<uint8_t>(i - 80));
  const DescriptorMatrix d2 = d1.colwise().reverse();
  PooledVector<BestTwo> rows, columns;
  FindBestTwo(d1, d2, {}, GetParam(), &rows, &columns);
  ExpectEqual(rows, OracleRows(d1, d2));
  ExpectEqual(columns, OracleRows(d2, d1));
}

// More rows and columns than a key can index: 255 or 511 of the largest, 8191 of RootSIFT's size.
TEST_P(FindBestTwoTest, BlocksBeyondTheKeysIndexAreMerged) {
  const DescriptorMatrix large1 = RandomDescriptors(1100, 255, 3), large2 = RandomDescriptors(600, 255, 4);
  DescriptorMatrix saturated = DescriptorMatrix::Constant(600, kSiftDescriptorDim, 255);
  const DescriptorMatrix few = RandomDescriptors(20, 60, 5);
  DescriptorMatrix many = RandomDescriptors(8500, 60, 6);
  many.row(8400) = many.row(3);
  for (const auto& [d1, d2] : {std::pair(large1, large2), std::pair(saturated, large1), std::pair(few, many),
                               std::pair(many, few)}) {
    PooledVector<BestTwo> rows, columns;
    FindBestTwo(d1, d2, {}, GetParam(), &rows, &columns);
    ExpectEqual(rows, OracleRows(d1, d2));
    ExpectEqual(columns, OracleRows(d2, d1));
  }
}

constexpr DescriptorSpace kSpaces[] = {{32, 128, DescriptorMeasure::kAngle, 1024.0 * 32},
                                       {64, 128, DescriptorMeasure::kDense, 1024.0 * 64},
                                       {101, 128, DescriptorMeasure::kAngle, 1024.0 * 101},
                                       {128, 128, DescriptorMeasure::kAngle, 1024.0 * 128},
                                       {256, 32, DescriptorMeasure::kHamming, 32.0 * 32 * 256},
                                       {488, 23, DescriptorMeasure::kHamming, 23.0 * 23 * 488},
                                       {1024, 128, DescriptorMeasure::kAngle, 1024.0 * 1024}};

TEST_P(FindBestTwoTest, OtherSpacesEqualBruteForceForAnyWidthAndSize) {
  for (const DescriptorSpace& space : kSpaces) {
    for (const auto& [size1, size2] :
         {std::pair(0, 3), std::pair(1, 1), std::pair(17, 40), std::pair(70, 33)}) {
      const DescriptorMatrix d1 = RandomDescriptorsOf(space, size1, 1);
      DescriptorMatrix d2 = RandomDescriptorsOf(space, size2, 2);
      if (size1 > 1) d2.row(5) = d2.row(9) = d1.row(3);  // equal ones: the smaller index is the best
      PooledVector<BestTwo> rows, columns;
      FindBestTwo(d1, d2, space, GetParam(), &rows, &columns);
      ExpectEqual(rows, OracleRows(d1, d2, space.offset));
      ExpectEqual(columns, OracleRows(d2, d1, space.offset));
    }
  }
}

TEST_P(FindBestTwoTest, ExtremeValuesOfOtherSpacesDoNotOverflow) {
  for (const DescriptorSpace& space : kSpaces) {
    DescriptorMatrix d1 = DescriptorMatrix::Constant(20, space.num_values, 255);
    d1.bottomRows(10).setZero();
    d1.row(4).setConstant(static_cast<uint8_t>(space.offset));  // in no direction: like none
    DescriptorMatrix d2 = DescriptorMatrix::Zero(35, space.num_values);
    d2.topRows(2).setConstant(255);
    PooledVector<BestTwo> rows, columns;
    FindBestTwo(d1, d2, space, GetParam(), &rows, &columns);
    ExpectEqual(rows, OracleRows(d1, d2, space.offset));
    ExpectEqual(columns, OracleRows(d2, d1, space.offset));
    EXPECT_EQ(rows[4].idx, -1);
  }
}

// More than one range of keys, and padding that would be better than what is opposite.
TEST_P(FindBestTwoTest, ManyDescriptorsOfOtherSpacesEqualBruteForce) {
  for (const DescriptorSpace& space : {kSpaces[1], kSpaces[6]}) {
    const DescriptorMatrix d1 = RandomDescriptorsOf(space, 30, 1), d2 = RandomDescriptorsOf(space, 2100, 2);
    PooledVector<BestTwo> rows, columns;
    FindBestTwo(d1, d2, space, GetParam(), &rows, &columns);
    ExpectEqual(rows, OracleRows(d1, d2, space.offset));
    ExpectEqual(columns, OracleRows(d2, d1, space.offset));
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, FindBestTwoTest, testing::ValuesIn(kMatchKernels),
                         [](const auto& param) { return std::string(NameOf(param.param)); });

// A unit vector of norm 512 along one axis, turned by `angle` towards the next.
void SetDirection(DescriptorMatrix* descriptors, int row, int axis, double angle) {
  descriptors->row(row).setZero();
  // Norm 512 does not fit into one byte: spread it over four equal values.
  for (int i = 0; i < 4; ++i) {
    (*descriptors)(row, 8 * axis + i) =
        static_cast<uint8_t>(std::min(255.0, std::round(256 * std::cos(angle))));
    (*descriptors)(row, 8 * axis + 4 + i) =
        static_cast<uint8_t>(std::min(255.0, std::round(256 * std::sin(angle))));
  }
}

TEST(MatchDescriptors, RatioTestDropsAmbiguousAndDistantMatches) {
  DescriptorMatrix d1(3, kSiftDescriptorDim), d2(4, kSiftDescriptorDim);
  SetDirection(&d1, 0, 0, 0.0);
  SetDirection(&d1, 1, 1, 0.0);
  SetDirection(&d1, 2, 2, 0.0);
  SetDirection(&d2, 0, 0, 0.2);   // a good match of 0
  SetDirection(&d2, 1, 1, 0.30);  // two candidates for 1, too alike
  SetDirection(&d2, 2, 1, 0.32);
  SetDirection(&d2, 3, 2, 1.0);  // too far from 2
  const PooledVector<Match> matches = MatchDescriptors(d1, d2, {}, {});
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0], (Match{0, 0}));
}

TEST(MatchDescriptors, TwoCandidatesAtNoDistanceAreAmbiguous) {
  DescriptorMatrix d1(1, kSiftDescriptorDim), d2(2, kSiftDescriptorDim);
  SetDirection(&d1, 0, 0, 0.0);
  d1.row(0).head(5).setConstant(255);  // beyond norm 512, as rounding makes them: an angle of 0
  d2.row(0) = d1.row(0);
  d2.row(1) = d1.row(0);
  EXPECT_TRUE(MatchDescriptors(d1, d2, {}, {}).empty());
  EXPECT_EQ(MatchDescriptors(d1, d2.topRows(1), {}, {}).size(), 1u);
}

TEST(MatchDescriptors, EmptySetsMatchNothing) {
  const DescriptorMatrix none(0, kSiftDescriptorDim);
  EXPECT_TRUE(MatchDescriptors(none, RandomDescriptors(5, 255, 1), {}, {}).empty());
  EXPECT_TRUE(MatchDescriptors(RandomDescriptors(5, 255, 1), none, {}, {}).empty());
}

// 0 bits differ from the best, 60 of 256 from the second: the ratio is that of Hamming distances.
TEST(MatchDescriptors, BitsAreComparedByHowManyDiffer) {
  const DescriptorSpace space{256, 32, DescriptorMeasure::kHamming, 32.0 * 32 * 256};
  const auto with_ones = [](int num) {
    DescriptorMatrix row = DescriptorMatrix::Zero(1, 256);
    row.leftCols(num).setConstant(64);
    return row;
  };
  DescriptorMatrix d2(2, 256);
  d2 << with_ones(40), with_ones(51);
  EXPECT_TRUE(MatchDescriptors(with_ones(0), with_ones(58), space, {}).empty()) << "0.7 rad are 57.03 bits";
  EXPECT_EQ(MatchDescriptors(with_ones(0), with_ones(57), space, {}).size(), 1u);
  EXPECT_EQ(MatchDescriptors(with_ones(0), d2, space, {.mutual = false}).size(), 1u) << "40 / 51 < 0.8";
  d2.row(1) = with_ones(49);
  EXPECT_TRUE(MatchDescriptors(with_ones(0), d2, space, {.mutual = false}).empty()) << "40 / 49 > 0.8";
}

TEST(PackedDescriptors, KeepToTheStatedMemoryInOtherSpaces) {
  for (const DescriptorSpace& space : kSpaces) {
    const PackedDescriptors packed(RandomDescriptorsOf(space, 300, 1), space);
    EXPECT_LE(packed.num_bytes(), PackedDescriptors::NumBytes(300, space.num_values)) << space.num_values;
    EXPECT_EQ(packed.space(), space);
  }
}

TEST(PackedDescriptors, MatchLikeUnpackedOnesAndKeepToTheStatedMemory) {
  const DescriptorMatrix d1 = 66 * RandomDescriptors(300, 1, 1);  // norms near 512
  DescriptorMatrix d2 = 66 * RandomDescriptors(200, 1, 2);
  d2.topRows(50) = d1.middleRows(100, 50);
  const PackedDescriptors packed1(d1), packed2(d2);
  EXPECT_EQ(packed1.size(), 300);
  EXPECT_GE(packed1.num_bytes(), 300 * kSiftDescriptorDim);
  EXPECT_LE(packed1.num_bytes(), PackedDescriptors::NumBytes(300, kSiftDescriptorDim));
  const PooledVector<Match> matches = MatchDescriptors(packed1, packed2, {});
  EXPECT_GE(matches.size(), 50u);
  EXPECT_EQ(matches, MatchDescriptors(d1, d2, {}, {}));
}

}  // namespace
}  // namespace cairn
