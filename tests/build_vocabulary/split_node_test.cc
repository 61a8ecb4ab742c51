#include "core/vocabulary/split_node.h"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/features/descriptor_distance.h"
#include "core/vocabulary/nearest_centre.h"

namespace cairn::build_vocabulary {
namespace {

// Like binary or learned descriptors: values on both sides of an offset.
const DescriptorSpace kSigned = {.num_values = 48, .offset = 128, .squared_norm = 400.0 * 400.0};

// Around as many directions as there are groups, as far apart as chance has them.
DescriptorMatrix Grouped(int num_rows, int num_groups, const DescriptorSpace& space, Random& random) {
  std::vector<Eigen::RowVectorXd> directions;
  for (int i = 0; i < num_groups; ++i) {
    Eigen::RowVectorXd& direction = directions.emplace_back(space.num_values);
    for (double& value : direction) value = space.offset > 0 ? random.Normal(0, 1) : random.Uniform();
  }
  DescriptorMatrix rows(num_rows, space.num_values);
  for (int i = 0; i < num_rows; ++i) {
    Eigen::RowVectorXd sum = directions[random.UniformInt(0, num_groups - 1)];
    for (double& value : sum) value += random.Normal(0, 0.2);
    rows.row(i) = MeanDescriptor(sum.array() + space.offset, 1, space);
  }
  return rows;
}

// What k-means ends with: every member is nearest to its child's centre, which is the mean of the child's.
void ExpectMeansOfNearestMembers(const DescriptorMatrix& rows, const DescriptorSpace& space,
                                 const std::vector<NodeChild>& children) {
  DescriptorMatrix centres(static_cast<Eigen::Index>(children.size()), space.num_values);
  for (size_t k = 0; k < children.size(); ++k) centres.row(k) = children[k].centre;
  std::vector<int32_t> all;
  for (size_t k = 0; k < children.size(); ++k) {
    ASSERT_FALSE(children[k].members.empty());
    EXPECT_TRUE(std::is_sorted(children[k].members.begin(), children[k].members.end()));
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(space.num_values);
    for (const int32_t member : children[k].members) {
      sum += rows.row(member).cast<double>();
      EXPECT_EQ(
          NearestCentre(centres.data(), static_cast<int>(children.size()), rows.row(member).data(), space),
          static_cast<int>(k));
    }
    EXPECT_EQ(children[k].centre,
              MeanDescriptor(sum, static_cast<int64_t>(children[k].members.size()), space));
    all.insert(all.end(), children[k].members.begin(), children[k].members.end());
  }
  std::sort(all.begin(), all.end());
  ASSERT_EQ(all.size(), static_cast<size_t>(rows.rows()));
  for (int32_t i = 0; i < rows.rows(); ++i) EXPECT_EQ(all[i], i) << "each is the member of one child";
}

std::vector<int32_t> Every(const DescriptorMatrix& rows) {
  std::vector<int32_t> members(rows.rows());
  for (int32_t i = 0; i < rows.rows(); ++i) members[i] = i;
  return members;
}

constexpr int kUntilNothingChanges = 1000;

TEST(SplitNode, EndsWithTheMeansOfTheNearest) {
  Random random(4);
  for (const DescriptorSpace& space : {DescriptorSpace(), kSigned}) {
    // More than twice the members that one task takes.
    const DescriptorMatrix rows = Grouped(9000, 4, space, random);
    for (const int num_threads : {1, 3}) {
      const auto children = SplitNode(rows, space, Every(rows), 4, kUntilNothingChanges, 9, num_threads);
      ASSERT_GE(children.size(), 2u);
      ExpectMeansOfNearestMembers(rows, space, children);
    }
  }
}

TEST(SplitNode, OfFewMembersLosesNoneWhereAClusterEndsEmpty) {
  const DescriptorSpace space = {.num_values = 3, .offset = 128, .squared_norm = 100 * 100};
  Random random(7);
  int num_pruned = 0;
  for (int i = 0; i < 500; ++i) {
    const DescriptorMatrix rows = Grouped(static_cast<int>(random.UniformInt(6, 60)), 12, space, random);
    const auto children = SplitNode(rows, space, Every(rows), 6, kUntilNothingChanges, i, 1);
    ASSERT_GE(children.size(), 2u);
    ASSERT_LE(children.size(), 6u);
    std::set<std::vector<uint8_t>> different;
    for (const auto& row : rows.rowwise()) different.emplace(row.begin(), row.end());
    num_pruned += children.size() < std::min<size_t>(6, different.size());
    ExpectMeansOfNearestMembers(rows, space, children);
  }
  EXPECT_GT(num_pruned, 0) << "else this test shows nothing";
}

TEST(SplitNode, OfTwoDirectionsHasAChildForEach) {
  // (255, 255, 0, ...) twice and (0, 0, 255, 255, 0, ...) three times, quantised to a norm of 512: at most
  // 255 where two values alone are not 0.
  DescriptorMatrix rows = DescriptorMatrix::Zero(5, kSiftDescriptorDim);
  for (const int row : {0, 3}) rows.row(row).head(2).setConstant(200);
  for (const int row : {1, 2, 4}) rows.row(row).segment(2, 2).setConstant(90);
  const auto children = SplitNode(rows, {}, {0, 1, 2, 3, 4}, 10, kUntilNothingChanges, 3, 1);
  ASSERT_EQ(children.size(), 2u);
  const size_t first = children[0].members[0] == 0 ? 0 : 1;
  EXPECT_THAT(children[first].members, testing::ElementsAre(0, 3));
  EXPECT_THAT(children[1 - first].members, testing::ElementsAre(1, 2, 4));
  DescriptorRow expected = DescriptorRow::Zero(kSiftDescriptorDim);
  expected.head(2).setConstant(255);
  EXPECT_EQ(children[first].centre, expected);
}

TEST(SplitNode, OfOneDirectionHasNoChildren) {
  Random random(2);
  DescriptorMatrix rows = Grouped(1, 1, {}, random).replicate(5, 1);
  EXPECT_TRUE(SplitNode(rows, {}, Every(rows), 3, kUntilNothingChanges, 3, 1).empty());
  EXPECT_TRUE(SplitNode(rows, {}, {2}, 3, kUntilNothingChanges, 3, 1).empty());
  EXPECT_TRUE(SplitNode(rows, {}, {}, 3, kUntilNothingChanges, 3, 1).empty());
}

}  // namespace
}  // namespace cairn::build_vocabulary
