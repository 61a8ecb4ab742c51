#include "runtime/drive/image_servo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

using testing::HasSubstr;

// Of a synthetic room, image 0 of its survey, and a servo that steers there.
class ImageServoTest : public testing::Test {
 protected:
  Result<ServoCommand> StepAt(const Pose& pose) {
    return servo_.StepFeatures(RenderFeatures(room_, pose, {}, 5), room_.camera);
  }

  SyntheticRoom room_ = MakeSyntheticRoom(1);
  Pose there_ = room_.rows.images[0].cam_from_world;
  ImageServo servo_ = *ImageServo::ToImage(*Map::FromRows(room_.rows), 0);
};

TEST_F(ImageServoTest, ArrivesWhereTheImageWasTakenAndDrivesToItFromBehind) {
  const ServoCommand arrived = *StepAt(there_);
  EXPECT_NE(arrived.state, ServoState::kLost) << arrived.why;
  EXPECT_GT(arrived.num_matches, 50);
  EXPECT_NEAR(arrived.speed_m_s, 0, 0.1);
  Pose behind = there_;
  behind.translation.z() += 1;  // a metre
  const ServoCommand command = *StepAt(behind);
  EXPECT_EQ(command.state, ServoState::kApproaching) << command.why;
  EXPECT_GT(command.speed_m_s, 0.2);
}

TEST_F(ImageServoTest, FeaturesWithoutTheirDescriptorsAreRefusedAndChangeNothing) {
  const Features seen = RenderFeatures(room_, there_, {}, 5);
  Features fewer = seen;
  fewer.keypoints.pop_back();
  const auto refused = servo_.StepFeatures(fewer, room_.camera);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(refused.error().message, HasSubstr("descriptors"));
  EXPECT_TRUE(servo_.StepFeatures(seen, room_.camera).ok());
  ServoTarget target = TargetOfFeatures(seen);
  EXPECT_TRUE(ImageServo::ToTarget(target, room_.camera).ok());
  target.pixels.pop_back();
  const auto no_target = ImageServo::ToTarget(target, room_.camera);
  ASSERT_FALSE(no_target.ok());
  EXPECT_EQ(no_target.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace cairn
