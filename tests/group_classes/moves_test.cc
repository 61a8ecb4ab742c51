#include "stages/group_classes/persistence/moves.h"

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/features/descriptor_distance.h"

namespace cairn::group_classes {
namespace {

// Classes of two changes of one session, seen from 3 m: what vanished at one and what appeared at the other.
class MovedThings : public testing::Test {
 protected:
  int Add(const Eigen::Vector3d& position, const Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim>& descriptor) {
    FeatureClass row;
    row.position = position;
    row.descriptor = descriptor;
    classes_.classes.push_back(row);
    return static_cast<int>(classes_.classes.size()) - 1;
  }

  Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim> RandomDescriptor() {
    Eigen::Matrix<double, 1, Eigen::Dynamic> sum(kSiftDescriptorDim);
    for (int i = 0; i < kSiftDescriptorDim; ++i) sum[i] = random_.Uniform() < 0.3 ? random_.Uniform() : 0.01;
    return MeanDescriptor(sum, 0);
  }

  // A thing of `num` classes within a square metre: it vanishes at change `from`, and the first `num_again`
  // of its classes appear at change `to`, moved and then displaced by `noise_m` each.
  void Move(int from, int to, const Eigen::Isometry3d& motion, int num, int num_again, double noise_m = 0) {
    for (int i = 0; i < num; ++i) {
      const Eigen::Vector3d place(random_.Uniform(), random_.Uniform(), 0);
      const auto descriptor = RandomDescriptor();
      members_[from].vanished.push_back(Add(place, descriptor));
      if (i >= num_again) continue;
      const Eigen::Vector3d noise(random_.Normal(0, noise_m), random_.Normal(0, noise_m), 0);
      members_[to].appeared.push_back(Add(motion * place + noise, descriptor));
    }
  }

  std::vector<PlaceChange> Found(int first = 0) {
    std::vector<PlaceChange> changes(members_.size());
    FindMoves(classes_, members_, first, 3, changes);
    return changes;
  }

  static Eigen::Isometry3d Motion(double x, double y, double turn_rad = 0) {
    return Eigen::Translation3d(x, y, 0) * Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY());
  }

  Random random_{7};
  Classes classes_;
  std::vector<ChangedClasses> members_{3};
};

TEST_F(MovedThings, AreFoundWhereTheyAreNow) {
  Move(0, 2, Motion(2, 0, 0.7), 60, 40, 0.01);
  Move(2, 0, Motion(-1, 0), 30, 30);
  const std::vector<PlaceChange> changes = Found(5);
  EXPECT_EQ(changes[0].moved_to, 7);
  EXPECT_NEAR(changes[0].num_moved, 40, 3);
  EXPECT_EQ(changes[2].moved_to, 5);
  EXPECT_EQ(changes[2].num_moved, 30);
  EXPECT_EQ(changes[1].moved_to, -1);
  EXPECT_EQ(changes[1].num_moved, 0);
}

TEST_F(MovedThings, MayStayWithinOneChange) {
  Move(1, 1, Motion(0.2, 0), 40, 40);
  EXPECT_EQ(Found()[1].moved_to, 1);
}

TEST_F(MovedThings, HaveMovedByMoreThanTheirPlacesAreUncertain) {
  Move(1, 1, Motion(0.05, 0), 40, 40);
  EXPECT_EQ(Found()[1].moved_to, -1);
}

TEST_F(MovedThings, KeepTheirShape) {
  Move(0, 1, Motion(2, 0), 60, 60, 0.5);
  EXPECT_EQ(Found()[0].moved_to, -1);
}

TEST_F(MovedThings, AreSeenAgainInTenClassesAndInSomePart) {
  Move(0, 1, Motion(2, 0), 40, 9);
  EXPECT_EQ(Found()[0].moved_to, -1);
  Move(0, 1, Motion(2, 0), 1, 1);
  EXPECT_EQ(Found()[0].moved_to, 1);
  // Of 400 ten are few, of those that vanished and of those that appeared.
  for (int i = 0; i < 400; ++i) members_[1].appeared.push_back(Add({0, 0, 0}, RandomDescriptor()));
  EXPECT_EQ(Found()[0].moved_to, 1);
  for (int i = 0; i < 400; ++i) members_[0].vanished.push_back(Add({0, 0, 0}, RandomDescriptor()));
  EXPECT_EQ(Found()[0].moved_to, -1);
}

TEST_F(MovedThings, WentWhereMostOfThemIs) {
  Move(0, 1, Motion(2, 0), 12, 12);
  Move(0, 2, Motion(3, 0), 20, 20);
  EXPECT_EQ(Found()[0].moved_to, 2);
  EXPECT_EQ(Found()[0].num_moved, 20);
}

TEST_F(MovedThings, AreNoneWhereNothingVanishedOrAppeared) {
  EXPECT_EQ(Found()[0].moved_to, -1);
  members_[0].appeared.push_back(Add({0, 0, 0}, RandomDescriptor()));
  EXPECT_EQ(Found()[0].moved_to, -1);
}

}  // namespace
}  // namespace cairn::group_classes
