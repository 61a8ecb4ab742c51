#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/c_api/cairn.h"
#include "runtime/drive/image_servo.h"
#include "tests/install/c_image.h"
#include "tests/install/poster_room.h"

namespace cairn {
namespace {

using testing::HasSubstr;

const PosterRoom& Room() {
  static const PosterRoom room;
  return room;
}

// On the way to r2: frames come nearer, 20 cm each, from 80 cm behind it.
class CServo : public testing::Test {
 protected:
  static constexpr int32_t kTarget = 2;

  CServo() : path_(testing::TempDir() + "/c_api_servo.cairn") {
    EXPECT_TRUE(WriteMapRows(Room().rows(), path_).ok());
    map_ = *Map::Open(path_);
    EXPECT_EQ(cairn_map_open(path_.c_str(), nullptr, &opened_), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_servo_create(opened_, kTarget, &servo_), CAIRN_OK) << cairn_last_error();
  }
  ~CServo() override {
    EXPECT_EQ(cairn_servo_destroy(servo_), CAIRN_OK);
    EXPECT_EQ(cairn_map_close(opened_), CAIRN_OK);
  }

  int32_t Step(const cv::Mat& picture, const cairn_camera* camera = nullptr) {
    const cairn_image image = ImageOf(picture);
    return cairn_servo_step(servo_, &image, camera, &command_);
  }
  void ExpectSame(const ServoCommand& expected) {
    EXPECT_EQ(command_.speed_m_s, expected.speed_m_s);
    EXPECT_EQ(command_.turn_rad_s, expected.turn_rad_s);
    EXPECT_STREQ(cairn_servo_state_name(command_.state), ServoStateName(expected.state));
    EXPECT_EQ(command_.num_matches, expected.num_matches);
    EXPECT_EQ(command_.num_inliers, expected.epipoles ? expected.epipoles->num_inliers : 0);
    EXPECT_EQ(std::string(command_.why), expected.why);
  }
  static cv::Mat Frame(int number) { return Room().PictureAt(-4 + 0.2 * number); }

  std::string path_;
  std::shared_ptr<const Map> map_;
  cairn_map* opened_ = nullptr;
  cairn_servo* servo_ = nullptr;
  cairn_servo_command command_ = CAIRN_SERVO_COMMAND_INIT;
};

TEST_F(CServo, CommandsAreThoseOfCxxBitForBitImageAfterImage) {
  ASSERT_EQ(cairn_map_close(opened_), CAIRN_OK);  // the servo keeps what it needs
  opened_ = nullptr;
  ImageServo expected = *ImageServo::ToImage(map_, kTarget);
  const Camera camera = *map_->CameraForSize(320, 240);
  const cv::Mat blank(240, 320, CV_8UC1, cv::Scalar(90));
  for (const cv::Mat& picture : {Frame(0), Frame(1), blank, Frame(2)}) {
    ASSERT_EQ(Step(picture), CAIRN_OK) << cairn_last_error();
    ExpectSame(*expected.Step(picture, camera));
    EXPECT_EQ(command_.step_s, 0.25);
    EXPECT_EQ(command_.state, picture.data == blank.data ? CAIRN_SERVO_LOST : CAIRN_SERVO_APPROACHING);
    EXPECT_EQ(command_.speed_m_s > 0, picture.data != blank.data);
  }
  ASSERT_EQ(cairn_servo_blocked(servo_), CAIRN_OK);
  expected.Blocked();
  ASSERT_EQ(Step(Frame(2)), CAIRN_OK);
  ExpectSame(*expected.Step(Frame(2), camera));
  EXPECT_THAT(command_.why, HasSubstr("retreats"));  // from what stopped it
}

TEST_F(CServo, ArrivesWhereTheImageWasTaken) {
  ASSERT_EQ(Step(Frame(4)), CAIRN_OK);
  EXPECT_EQ(command_.state, CAIRN_SERVO_ARRIVED) << command_.why;
  EXPECT_EQ(command_.speed_m_s, 0);
  EXPECT_EQ(command_.turn_rad_s, 0);
}

// A camera of twice the focal length and size: the same rays.
TEST_F(CServo, TakesACameraThatIsNotTheSurveys) {
  cv::Mat large;
  cv::resize(Frame(0), large, {}, 2, 2, cv::INTER_CUBIC);
  EXPECT_EQ(Step(large), CAIRN_NOT_FOUND);
  cairn_camera camera = CAIRN_CAMERA_INIT;
  camera.width = 640;
  camera.height = 480;
  camera.num_params = 3;
  camera.params[0] = 560;
  camera.params[1] = 320;
  camera.params[2] = 240;
  ASSERT_EQ(Step(large, &camera), CAIRN_OK) << cairn_last_error();
  const cairn_servo_command of_large = command_;
  ASSERT_EQ(cairn_servo_set_option(servo_, "step_s", "0.25"), CAIRN_OK);  // anew
  ASSERT_EQ(Step(Frame(0)), CAIRN_OK) << cairn_last_error();
  EXPECT_NEAR(of_large.speed_m_s, command_.speed_m_s, 0.1);
  EXPECT_NEAR(of_large.turn_rad_s, command_.turn_rad_s, 0.1);
  EXPECT_GT(of_large.num_inliers, 40);
}

TEST_F(CServo, IsForOneCameraAndAnErrorStopsTheRobotAndChangesNothing) {
  ImageServo expected = *ImageServo::ToImage(map_, kTarget);
  const Camera survey = *map_->CameraForSize(320, 240);
  ASSERT_EQ(Step(Frame(0)), CAIRN_OK);
  ExpectSame(*expected.Step(Frame(0), survey));
  cairn_camera camera = CAIRN_CAMERA_INIT;
  camera.width = 320;
  camera.height = 240;
  camera.num_params = 3;
  camera.params[0] = 300;
  camera.params[1] = 160;
  camera.params[2] = 120;
  EXPECT_EQ(Step(Frame(1), &camera), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("another camera than before"));
  EXPECT_EQ(command_.speed_m_s, 0);
  EXPECT_EQ(command_.state, CAIRN_SERVO_LOST);
  EXPECT_EQ(Step(Frame(1)(cv::Rect(0, 0, 100, 100))), CAIRN_NOT_FOUND);
  camera.width = 100;
  EXPECT_EQ(Step(Frame(1), &camera), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("320 x 240 px of a camera of 100 x 240"));
  ASSERT_EQ(Step(Frame(1)), CAIRN_OK);
  ExpectSame(*expected.Step(Frame(1), survey));
}

TEST_F(CServo, OptionsHaveAnEffectAndOthersAreRefused) {
  ASSERT_EQ(cairn_servo_set_option(servo_, "max_speed_m_s", "0.1"), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_servo_set_option(servo_, "step_s", "0.5"), CAIRN_OK);
  ASSERT_EQ(Step(Frame(0)), CAIRN_OK);
  EXPECT_LE(command_.speed_m_s, 0.1);
  EXPECT_GT(command_.speed_m_s, 0);
  EXPECT_EQ(command_.step_s, 0.5);
  ASSERT_EQ(cairn_servo_set_option(servo_, "max_num_features", "20"), CAIRN_OK);
  ASSERT_EQ(Step(Frame(0)), CAIRN_OK);
  EXPECT_LE(command_.num_matches, 20);
  ASSERT_EQ(cairn_servo_set_option(servo_, "min_num_inliers", "1000"), CAIRN_OK);
  ASSERT_EQ(Step(Frame(0)), CAIRN_OK);
  EXPECT_EQ(command_.state, CAIRN_SERVO_LOST);
  for (const auto& [name, value] :
       {std::pair("max_speed_m_s", "-1"), std::pair("max_speed_m_s", "nan"), std::pair("step_s", ""),
        std::pair("score_exponent", "1"), std::pair("keypoint_sigma_px", "1")}) {
    EXPECT_EQ(cairn_servo_set_option(servo_, name, value), CAIRN_INVALID_ARGUMENT) << name << value;
  }
  EXPECT_THAT(cairn_last_error(), HasSubstr("servo.h"));
}

TEST_F(CServo, RefusesWhatCannotBe) {
  cairn_servo* none = servo_;
  EXPECT_EQ(cairn_servo_create(opened_, 4, &none), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("image 4 of 4"));
  EXPECT_EQ(none, nullptr);
  EXPECT_EQ(cairn_servo_create(opened_, -1, &none), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_servo_create(nullptr, 0, &none), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_servo_create(opened_, 0, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_servo_set_option(servo_, nullptr, "1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_servo_set_option(servo_, "step_s", nullptr), CAIRN_INVALID_ARGUMENT);
  const cairn_image image = ImageOf(Frame(0));
  EXPECT_EQ(cairn_servo_step(nullptr, &image, nullptr, &command_), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_servo_step(servo_, nullptr, nullptr, &command_), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_servo_step(servo_, &image, nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  command_.size = 8;
  EXPECT_EQ(cairn_servo_step(servo_, &image, nullptr, &command_), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("command->size is 8"));
  command_.size = sizeof(command_);
  EXPECT_EQ(cairn_servo_step(reinterpret_cast<cairn_servo*>(opened_), &image, nullptr, &command_),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("not a servo"));
  EXPECT_EQ(cairn_servo_blocked(nullptr), CAIRN_INVALID_ARGUMENT);
  ASSERT_EQ(cairn_servo_blocked(servo_), CAIRN_OK);  // before any image
  ASSERT_EQ(cairn_servo_create(opened_, 0, &none), CAIRN_OK);
  ASSERT_EQ(cairn_servo_destroy(none), CAIRN_OK);
  EXPECT_EQ(cairn_servo_destroy(none), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_servo_step(none, &image, nullptr, &command_), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("destroyed"));
  EXPECT_STREQ(cairn_servo_state_name(4), "unknown");
  EXPECT_STREQ(cairn_servo_state_name(CAIRN_SERVO_TURNING), "turning");
}

// 80 cm behind the target, at a speed_gain of 1.5 a second: 1.2 m/s, where nothing was learnt yet.
TEST_F(CServo, AMapInMetresSaysHowFastToDrive) {
  ASSERT_EQ(cairn_servo_set_option(servo_, "max_speed_m_s", "5"), CAIRN_OK);
  ASSERT_EQ(Step(Frame(0)), CAIRN_OK);
  EXPECT_NEAR(command_.speed_m_s, 1.2, 0.4);
  MapRows rows = Room().rows();
  rows.frame.unit = "arbitrary";
  const std::string path = testing::TempDir() + "/c_api_servo_unit.cairn";
  ASSERT_TRUE(WriteMapRows(rows, path).ok());
  cairn_map* map = nullptr;
  ASSERT_EQ(cairn_map_open(path.c_str(), nullptr, &map), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_servo_destroy(servo_), CAIRN_OK);
  ASSERT_EQ(cairn_servo_create(map, kTarget, &servo_), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(Step(Frame(0)), CAIRN_OK);
  EXPECT_LT(command_.speed_m_s, 0.4);  // as if the scene were a metre away
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

TEST_F(CServo, AnImageWithoutLandmarksIsNoTarget) {
  MapRows rows = Room().rows();
  rows.images[kTarget].landmarks.clear();
  const std::string path = testing::TempDir() + "/c_api_servo_bare.cairn";
  ASSERT_TRUE(WriteMapRows(rows, path).ok());
  cairn_map* map = nullptr;
  cairn_servo* none = servo_;
  ASSERT_EQ(cairn_map_open(path.c_str(), nullptr, &map), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(cairn_servo_create(map, kTarget, &none), CAIRN_NO_DATA);
  EXPECT_THAT(cairn_last_error(), HasSubstr("image r2 shows none of the map's landmarks"));
  EXPECT_EQ(none, nullptr);
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

}  // namespace
}  // namespace cairn
