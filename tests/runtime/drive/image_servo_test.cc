#include "runtime/drive/image_servo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/option_limits.h"
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

// In a map in metres the speed is that of the way: 1.5 a second of the metre that is left.
TEST_F(ImageServoTest, TheMapSaysHowFarTheSceneIs) {
  Pose behind = there_;
  behind.translation.z() += 1;
  const Features seen = RenderFeatures(room_, behind, {}, 5);
  ImageServoOptions options;
  options.servo.max_speed_m_s = 10;
  for (const double guess_m : {0.1, 100.0}) {
    options.servo.scene_distance_m = guess_m;
    ImageServo servo = *ImageServo::ToImage(*Map::FromRows(room_.rows), 0, options);
    EXPECT_NEAR(servo.StepFeatures(seen, room_.camera)->speed_m_s, 1.5, 0.3);
  }
  // Without a unit the guess counts.
  MapRows rows = room_.rows;
  rows.frame.unit = "arbitrary";
  ImageServo servo = *ImageServo::ToImage(*Map::FromRows(rows), 0, options);
  EXPECT_GT(servo.StepFeatures(seen, room_.camera)->speed_m_s, 5);
}

TEST_F(ImageServoTest, IsForOneCameraAndItsImages) {
  const Features seen = RenderFeatures(room_, there_, {}, 5);
  ASSERT_TRUE(servo_.StepFeatures(seen, room_.camera).ok());
  Camera other = room_.camera;
  other.params[0] += 1;
  EXPECT_THAT(servo_.StepFeatures(seen, other).error().message, HasSubstr("another camera than before"));
  other = room_.camera;
  other.width += 1;
  EXPECT_EQ(servo_.StepFeatures(seen, other).error().code, ErrorCode::kInvalidArgument);
  other = room_.camera;
  other.height += 1;
  EXPECT_EQ(servo_.StepFeatures(seen, other).error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(servo_.StepFeatures(seen, room_.camera).ok());
  for (const cv::Size& size : {cv::Size(640, 481), cv::Size(639, 480)}) {
    EXPECT_THAT(servo_.Step(cv::Mat::zeros(size, CV_8U), room_.camera).error().message,
                HasSubstr("of a camera of 640 x 480 px"));
  }
  EXPECT_EQ(servo_.Step(cv::Mat::zeros(480, 640, CV_8U), room_.camera)->state, ServoState::kLost);
}

TEST_F(ImageServoTest, AnImageWithoutLandmarksIsNoTarget) {
  MapRows rows = room_.rows;
  rows.images[3].landmarks.clear();
  const auto map = *Map::FromRows(rows);
  EXPECT_EQ(ImageServo::ToImage(map, 3).error().code, ErrorCode::kNoData);
  for (const int32_t image : {-1, static_cast<int32_t>(map->num_images())})
    EXPECT_EQ(ImageServo::ToImage(map, image).error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(ImageServo::ToImage(map, static_cast<int32_t>(map->num_images()) - 1).ok());
}

// A landmark is where a camera at the image's pose has it, with the descriptor that the map says.
TEST_F(ImageServoTest, TargetOfAnImageIsItsLandmarksThere) {
  const auto map = *Map::FromRows(room_.rows);
  const MapImage& image = room_.rows.images[0];
  Camera narrow = room_.camera;
  narrow.params[0] = 750;
  for (const Camera& camera : {room_.camera, narrow}) {
    const ServoTarget target = *TargetOfImage(*map, 0, camera);
    ASSERT_EQ(target.pixels.size(), image.landmarks.size());
    for (size_t i = 0; i < target.pixels.size(); ++i) {
      const auto pixel = ImageFromCamera(camera, there_ * room_.points[image.landmarks[i]]);
      EXPECT_LT((target.pixels[i] - *pixel).norm(), 1e-6);
      EXPECT_EQ(target.descriptors.row(static_cast<Eigen::Index>(i)),
                room_.descriptors.row(image.landmarks[i]));
    }
  }
  EXPECT_EQ(TargetOfImage(*map, 0)->pixels[5], TargetOfImage(*map, 0, room_.camera)->pixels[5]);
  narrow.params[0] = -1;
  EXPECT_EQ(TargetOfImage(*map, 0, narrow).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(ImageServoTest, MatchedPixelsAreOfTheSameThings) {
  const Features seen = RenderFeatures(room_, there_, {.num_outliers = 0}, 5);
  const ServoTarget target = TargetOfFeatures(seen);
  const std::vector<PixelPair> pairs = MatchPixels(seen, target);
  ASSERT_GT(pairs.size(), seen.keypoints.size() / 2);
  for (const PixelPair& pair : pairs) EXPECT_EQ(pair.current_px, pair.target_px);
  EXPECT_GT(NumAgreeing(seen, target, room_.camera, {}), 50);
  Camera bad = room_.camera;
  bad.params[0] = -1;
  EXPECT_EQ(NumAgreeing(seen, target, bad, {}), 0);
  EXPECT_EQ(NumAgreeing({}, target, room_.camera, {}), 0);
}

TEST(PassingServo, IsLessExactingOnItsWay) {
  ServoOptions options;
  options.max_speed_m_s = 0.7;
  const ServoOptions passing = PassingServo(options, {.pass_distance_ratio = 0.05, .pass_heading_deg = 6});
  EXPECT_EQ(passing.arrive_distance_ratio, 0.05);
  EXPECT_EQ(passing.arrive_heading_deg, 6);
  EXPECT_EQ(passing.max_speed_m_s, 0.7);
}

TEST(PassingServo, RangesOfItsOptions) {
  ExpectLimits<PassOptions>({{"pass_distance_ratio", "0.0001", "0.00009", "1", "1.001"},
                             {"pass_heading_deg", "0.001", "0.0009", "45", "45.001"}});
}

}  // namespace
}  // namespace cairn
