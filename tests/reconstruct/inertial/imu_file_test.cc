#include "stages/reconstruct/inertial/imu_file.h"

#include <filesystem>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "stages/reconstruct/inertial/image_times.h"

namespace cairn::reconstruct {
namespace {

using testing::HasSubstr;

class ReadImuTest : public testing::Test {
 protected:
  // Two seconds at rest, `step_ns` apart, with these values.
  static std::string AtRest(const char* values = "0.01,0,0,0,0,9.8", int64_t step_ns = 5'000'000) {
    std::string text;
    for (int64_t t = 0; t <= 2'000'000'000; t += step_ns) text += fmt::format("{},{}\n", t + 7, values);
    return text;
  }
  Result<ImuRecording> Read(const std::string& text) {
    path_ = testing::TempDir() + "imu_file_test.csv";
    EXPECT_TRUE(WriteFileAtomically(path_, text).ok());
    return ReadImu(path_);
  }
  std::string ErrorOf(const std::string& text, ErrorCode code) {
    const auto imu = Read(text);
    if (imu.ok()) return "read";
    EXPECT_EQ(imu.error().code, code) << imu.error().message;
    EXPECT_THAT(imu.error().message, HasSubstr(path_));
    return imu.error().message;
  }
  std::string path_;
};

TEST_F(ReadImuTest, SamplesHaveTimesTurnsAndAccelerations) {
  const auto imu = Read("#timestamp [ns],w_x\r\n#imu_on_camera, 0.1,0.2,0.3, 0,0,0.6,0.8\n" +
                        AtRest("0.1,0.2,0.3,0.4,0.5,9.6"));
  ASSERT_TRUE(imu.ok()) << imu.error().message;
  ASSERT_EQ(imu->samples.size(), 401u);
  EXPECT_EQ(imu->samples[1].time_ns, 5'000'007);
  EXPECT_EQ(imu->samples[1].gyro, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(imu->samples[1].accel, Eigen::Vector3d(0.4, 0.5, 9.6));
  EXPECT_DOUBLE_EQ(imu->typical_step_s, 0.005);
  EXPECT_EQ(imu->cam_from_imu->translation, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_DOUBLE_EQ(imu->cam_from_imu->rotation.w(), 0.8);
  // A first line of words, and no place.
  EXPECT_FALSE(Read("timestamp,gx,gy,gz,ax,ay,az\n" + AtRest())->cam_from_imu.has_value());
}

TEST_F(ReadImuTest, ALineThatIsNoneIsNamed) {
  EXPECT_THAT(ErrorOf("0,0,0,0,0,0\n", ErrorCode::kCorrupt), HasSubstr(".csv:1: expected TIME_NS,WX"));
  EXPECT_THAT(ErrorOf("0,0,0,0,0,0,9.8\n5,nan,0,0,0,0,9.8\n", ErrorCode::kCorrupt),
              HasSubstr(".csv:2: expected"));
  EXPECT_THAT(ErrorOf("0.5,0,0,0,0,0,9.8\n", ErrorCode::kCorrupt), HasSubstr("an integer, nanoseconds"));
  EXPECT_THAT(ErrorOf("5,0,0,0,0,0,9.8\n5,0,0,0,0,0,9.8\n", ErrorCode::kCorrupt),
              HasSubstr(".csv:2: the time 5 is not after 5, the one before: sort the lines"));
  EXPECT_THAT(ErrorOf("5,0,0,0,0,0,9.8\ntime,0,0,0,0,0,9.8\n", ErrorCode::kCorrupt), HasSubstr(".csv:2:"));
  EXPECT_THAT(ErrorOf("#imu_on_camera,1,2,3\n", ErrorCode::kCorrupt), HasSubstr("expected #imu_on_camera,X"));
  EXPECT_THAT(ErrorOf("#imu_on_camera,0,0,0,0,0,0,2\n", ErrorCode::kCorrupt), HasSubstr("length 2, not 1"));
  EXPECT_THAT(ErrorOf("#imu_on_camera,0,0,0,0,0,0,1\n#imu_on_camera,0,0,0,0,0,0,1\n", ErrorCode::kCorrupt),
              HasSubstr("stands there twice"));
}

TEST_F(ReadImuTest, WhatNoImuSaysIsNamed) {
  EXPECT_THAT(ErrorOf("", ErrorCode::kNoData), HasSubstr("0 samples"));
  EXPECT_THAT(ErrorOf(AtRest("0,0,0,0,0,1"), ErrorCode::kNoData),
              HasSubstr("1 m/s^2 on the median, not gravity's 9.81: in g?"));
  EXPECT_THAT(ErrorOf(AtRest("0,0,0,0,0,1000"), ErrorCode::kNoData), HasSubstr(": in mg?"));
  EXPECT_THAT(ErrorOf(AtRest("0,0,0,0,0,0.1"), ErrorCode::kNoData), HasSubstr("with gravity taken out?"));
  EXPECT_THAT(ErrorOf(AtRest("0,0,0,0,0,30"), ErrorCode::kNoData),
              HasSubstr("30 m/s^2 on the median, not gravity's 9.81."));
  EXPECT_THAT(ErrorOf(AtRest("40,0,0,0,0,9.8"), ErrorCode::kNoData), HasSubstr("in degrees a second?"));
  EXPECT_THAT(ErrorOf(AtRest("0,0,0,0,0,9.8", 25'000'000), ErrorCode::kNoData),
              HasSubstr("40 samples a second; 50 to 10000 are of use"));
  EXPECT_THAT(ErrorOf(AtRest("0,0,0,0,0,9.8", 20'000'001), ErrorCode::kNoData),
              HasSubstr("50 samples a second"));
  EXPECT_TRUE(Read(AtRest("0,0,0,0,0,9.8", 20'000'000)).ok());
  EXPECT_THAT(ErrorOf("0,0,0,0,0,0,9.8\n5000,0,0,0,0,0,9.8\n", ErrorCode::kNoData), HasSubstr("nanoseconds"));
  EXPECT_THAT(ErrorOf("0,0,0,0,0,0,9.8\n5000000,0,0,0,0,0,9.8\n", ErrorCode::kNoData),
              HasSubstr("0.005 s are too short"));
}

TEST(TimeOfImage, IsItsName) {
  EXPECT_EQ(TimeOfImageNs("a/0000000010.050000000.png"), 10'050'000'000);
  EXPECT_EQ(TimeOfImageNs("000012.345.jpg"), 12'345'000'000);
  EXPECT_EQ(TimeOfImageNs("1305031102.175304.png"), 1'305'031'102'175'304'000);
  EXPECT_EQ(TimeOfImageNs("cam0/1403636579763555584.png"), 1'403'636'579'763'555'584);
  for (const char* name : {"000012.jpg", "123456789.jpg", "a.5.jpg", "1.5b.jpg", "1-2.jpg", "12..jpg",
                           ".5.jpg", "", "99999999999999.5.jpg"})
    EXPECT_FALSE(TimeOfImageNs(name).has_value()) << name;
}

}  // namespace
}  // namespace cairn::reconstruct
