#include "core/geometry/trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

using testing::HasSubstr;

constexpr int64_t kSecond = 1'000'000'000;

// 1 m and a radian a second, from 10 s to 14 s, stated every two seconds and out of order.
class TrajectoryTest : public testing::Test {
 protected:
  void SetUp() override {
    for (const int second : {14, 10, 12})
      trajectory_.Add(second * kSecond,
                      {Eigen::Quaterniond(Eigen::AngleAxisd(second - 10, Eigen::Vector3d::UnitZ())),
                       {second - 10.0, 0, 0}});
    trajectory_.Sort();
  }
  Trajectory trajectory_;
};

TEST_F(TrajectoryTest, IsBetweenTheStatedPosesAroundATime) {
  const Result<Pose> pose = trajectory_.At(10 * kSecond + kSecond / 2, 1.5);
  ASSERT_TRUE(pose.ok()) << pose.error().message;
  EXPECT_NEAR(pose->translation.x(), 0.5, 1e-12);
  EXPECT_NEAR(Eigen::AngleAxisd(pose->rotation).angle(), 0.5, 1e-12);
}

TEST_F(TrajectoryTest, AStatedTimeNeedsNoNeighbours) {
  for (const int second : {10, 12, 14})
    EXPECT_EQ(trajectory_.At(second * kSecond, 0)->translation.x(), second - 10) << second;
}

TEST_F(TrajectoryTest, OfTwoAtOneTimeTheFirstHolds) {
  trajectory_.Add(12 * kSecond, {Eigen::Quaterniond::Identity(), {7, 0, 0}});
  trajectory_.Sort();
  EXPECT_EQ(trajectory_.At(12 * kSecond, 0)->translation.x(), 2);
}

TEST_F(TrajectoryTest, BothNeighboursMustBeNear) {
  for (const int64_t time_ns : {10 * kSecond + kSecond / 2, 11 * kSecond + kSecond / 2}) {
    const Result<Pose> pose = trajectory_.At(time_ns, 1.49);
    ASSERT_FALSE(pose.ok());
    EXPECT_EQ(pose.error().code, ErrorCode::kNoData);
    EXPECT_THAT(pose.error().message, HasSubstr("1.500 s"));
  }
}

TEST_F(TrajectoryTest, NothingIsKnownBeforeTheFirstOrAfterTheLast) {
  EXPECT_THAT(trajectory_.At(10 * kSecond - 1, 100).error().message, HasSubstr("no stated pose before it"));
  EXPECT_THAT(trajectory_.At(14 * kSecond + 1, 100).error().message, HasSubstr("no stated pose after it"));
  EXPECT_FALSE(Trajectory().At(0, 100).ok());
  EXPECT_TRUE(Trajectory().empty());
  EXPECT_FALSE(trajectory_.empty());
}

}  // namespace
}  // namespace cairn
