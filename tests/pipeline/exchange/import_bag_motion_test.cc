// Bags as captures: odometry, IMU, frames and clocks.
#include "pipeline/exchange/bags/import_bag.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "core/base/text.h"
#include "core/files/file.h"
#include "tests/pipeline/exchange/imported_bag.h"

namespace cairn::pipeline {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

TEST_F(ImportedBag, HasTheImuAndWhereItIsOnTheCamera) {
  const auto imu = [](int64_t time_ns, const std::string& topic = "/imu", bool has_accel = true) -> Recorded {
    return {
        topic, "sensor_msgs/msg/Imu", time_ns,
        ImuBytes(
            {.stamp_ns = time_ns, .turn = {0.1, 0.2, 0.3}, .accel = {1, 2, 9.5}, .has_accel = has_accel})};
  };
  // The IMU is on base_link, turned by 180 degrees about z.
  const Recorded mount = {"/tf_static", kTf, 0,
                          TransformBytes({{"base_link", "imu_link", Turned(180, 0.1, 0, 0.2)}})};
  std::vector<Recorded> messages = {
      StaticFrames(), mount, imu(9'900'000'000), GreyMessage(10), imu(10'100'000'000), imu(10'100'000'000)};
  const auto report = Import(messages);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->num_imu_samples, 2);
  EXPECT_THAT(warnings_,
              Contains(HasSubstr("1 messages of the IMU are left out, whose stamps are not after")));
  const std::string csv = *ReadFile(root_ + "/capture/imu.csv");
  const auto lines = SplitLines(csv);
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_EQ(lines[2], "9900000000,0.1,0.2,0.3,1,2,9.5");
  const auto place = ParseNumbers(lines[1].substr(std::string("#imu_on_camera,").size()));
  ASSERT_TRUE(place && place->size() == 7) << lines[1];
  // Seen from the camera: behind it by 0.2 m, 0.3 m below; its z is up, the camera's -y.
  EXPECT_LT((Eigen::Vector3d((*place)[0], (*place)[1], (*place)[2]) - Eigen::Vector3d(0, 0.3, -0.2)).norm(),
            1e-9);
  const Eigen::Quaterniond q((*place)[6], (*place)[3], (*place)[4], (*place)[5]);
  EXPECT_LT((q * Eigen::Vector3d::UnitZ() + Eigen::Vector3d::UnitY()).norm(), 1e-9);
  EXPECT_LT((q * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitZ()).norm(), 1e-9);

  // An option goes before tf, and none leaves it out.
  BagOptions options = kAll;
  options.camera_from_imu = Pose{Eigen::Quaterniond::Identity(), {1, 2, 3}};
  ASSERT_TRUE(Import(messages, options).ok());
  EXPECT_THAT(*ReadFile(root_ + "/capture/imu.csv"), HasSubstr("\n#imu_on_camera,1,2,3,0,0,0,1\n"));
  options.imu = "none";
  ASSERT_TRUE(Import(messages, options).ok());
  EXPECT_FALSE(Has("imu.csv"));
  // A topic of turns alone is none; without tf the place is left open, and that is said.
  messages = {GreyMessage(10), imu(9'900'000'000), imu(10'100'000'000), imu(10'000'000'000, "/gyro", false)};
  ASSERT_TRUE(Import(messages).ok());
  EXPECT_THAT(warnings_, Contains(HasSubstr("/tf does not say where the IMU ('imu_link') is on the camera")));
  EXPECT_THAT(*ReadFile(root_ + "/capture/imu.csv"), Not(HasSubstr("imu_on_camera")));
  // Of two none is taken unless one is named.
  messages.push_back(imu(10'000'000'000, "/other"));
  ASSERT_TRUE(Import(messages).ok());
  EXPECT_FALSE(Has("imu.csv"));
  EXPECT_THAT(warnings_, Contains(HasSubstr("several topics have an IMU (/imu, /other)")));
  options = kAll;
  options.imu = "imu";
  ASSERT_TRUE(Import(messages, options).ok());
  EXPECT_TRUE(Has("imu.csv"));
  options.imu = "/camera/image_raw";
  EXPECT_THAT(ErrorOf(messages, options), HasSubstr("has no IMU (sensor_msgs/Imu), but sensor_msgs/Image"));
  // Another clock.
  ASSERT_TRUE(Import({GreyMessage(10), imu(99'000'000'000)}).ok());
  EXPECT_FALSE(Has("imu.csv"));
  EXPECT_THAT(warnings_, Contains(HasSubstr("are of two clocks")));
}

TEST_F(ImportedBag, WithoutAWayFromBaseToCameraHasNoOdometry) {
  ASSERT_TRUE(Import({GreyMessage(1),
                      OdometryMessageAt(1, {}),
                      {"/tf_static", kTf, 0, TransformBytes({{"mast", "camera_optical", kOptical}})}})
                  .ok());
  EXPECT_FALSE(Has("odometry.txt"));
  EXPECT_THAT(warnings_, Contains(AllOf(HasSubstr("odometry is left out"), HasSubstr("'camera_optical'"),
                                        HasSubstr("'base_link'"), HasSubstr("'mast'"))));
  // Images that name no frame.
  RawImage nowhere = Grey(1);
  nowhere.frame = "";
  ASSERT_TRUE(
      Import({{"/i", kImage, 0, ImageBytes(nowhere)}, OdometryMessageAt(1, {}), StaticFrames()}).ok());
  EXPECT_FALSE(Has("odometry.txt"));
  EXPECT_THAT(warnings_, Contains(HasSubstr("odometry is left out: images name no frame")));
  // Frames in a ring.
  ASSERT_TRUE(
      Import({GreyMessage(1),
              OdometryMessageAt(1, {}),
              {"/tf_static", kTf, 0,
               TransformBytes({{"a", "camera_optical", kOptical}, {"camera_optical", "a", kOptical}})}})
          .ok());
  EXPECT_FALSE(Has("odometry.txt"));
}

TEST_F(ImportedBag, FramesThatMoveAreTakenAtTheTimeOfTheImage) {
  // A mast turns the camera by 90 degrees in 0.2 s; base and camera hang from base_footprint.
  const auto mast = [](double time_s, double yaw_deg) {
    const int64_t time_ns = std::llround(time_s * 1e9);
    return Recorded{"/tf", kTf, time_ns,
                    TransformBytes({{"base_footprint", "mast", Turned(yaw_deg, 0, 0, 2), time_ns}})};
  };
  const auto report = Import({{"/tf_static", kTf, 0,
                               TransformBytes({{"mast", "camera_optical", kOptical},
                                               {"base_footprint", "base_link", Turned(0, 0, 0, 0.5)}})},
                              mast(10, 0),
                              mast(10.2, 90),
                              mast(12, 90),
                              OdometryMessageAt(9.9, {}),
                              OdometryMessageAt(10.1, {}),
                              OdometryMessageAt(10.2, {}),
                              OdometryMessageAt(11, {}),
                              OdometryMessageAt(11.1, {}),
                              GreyMessage(10.1),
                              GreyMessage(11.05)});
  ASSERT_TRUE(report.ok()) << report.error().message;
  const auto odometry = ReadOdometry();
  ASSERT_EQ(odometry.size(), 1u);  // at 11.05 s the mast was seen 0.85 s before and 0.95 s after
  EXPECT_THAT(warnings_, Contains(AllOf(HasSubstr("1 of 2 images have no odometry"), HasSubstr("'mast'"))));
  EXPECT_NEAR(odometry[0].world_from_camera.translation.z(), 1.5, 1e-9);
  const double half = std::sqrt(0.5);
  EXPECT_LT(
      (odometry[0].world_from_camera.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d(half, half, 0))
          .norm(),
      1e-9);
}

TEST_F(ImportedBag, OdometryFarFromAnImageIsNotStretched) {
  const std::vector<Recorded> messages = {
      StaticFrames(),  OdometryMessageAt(9, {}), OdometryMessageAt(11, Turned(0, 2, 0, 0)),
      GreyMessage(10), GreyMessage(11),          GreyMessage(12)};
  ASSERT_TRUE(Import(messages).ok());
  EXPECT_EQ(ReadOdometry().size(), 1u);
  EXPECT_THAT(warnings_,
              Contains(HasSubstr("2 of 3 images have no odometry; the first: the stated poses around "
                                 "it are 1.000 s before and 1.000 s after")));
  ASSERT_TRUE(Import(messages, {.choice = FrameChoice::kAll, .max_time_gap_s = 1}).ok());
  EXPECT_EQ(ReadOdometry().size(), 2u);
}

TEST_F(ImportedBag, TheCamerasPlaceThatIsAskedForCountsMoreThanThatOfTheBag) {
  BagOptions options = kAll;
  // Looks to the left from half a metre up: its z is the robot's y, its x the robot's x.
  options.base_from_camera = Pose{Eigen::Quaterniond(std::sqrt(0.5), -std::sqrt(0.5), 0, 0), {0, 0, 0.5}};
  for (const bool has_frames : {false, true}) {
    std::vector<Recorded> messages = {OdometryMessageAt(10, Turned(90, 1, 2, 0)), GreyMessage(10)};
    if (has_frames) messages.insert(messages.begin(), StaticFrames());
    ASSERT_TRUE(Import(messages, options).ok());
    const std::vector<OdometryLine> lines = ReadOdometry();
    ASSERT_EQ(lines.size(), 1u);
    const Pose& pose = lines[0].world_from_camera;
    EXPECT_LT((pose.translation - Eigen::Vector3d(1, 2, 0.5)).norm(), 1e-9);
    // The robot looks along the world's y; its left is the world's -x.
    EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d(-1, 0, 0)).norm(), 1e-9);
    EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d(0, 1, 0)).norm(), 1e-9);
  }
  ASSERT_TRUE(Import({OdometryMessageAt(10, {}), GreyMessage(10)}).ok());
  EXPECT_FALSE(Has("odometry.txt"));
  EXPECT_THAT(warnings_, Contains(HasSubstr("--camera-on-robot states it")));
}

TEST_F(ImportedBag, OdometryThatJumpsIsSaid) {
  // 1.2 m in a tenth of a second are no drive; 0.4 m are a slip, and 3 m in a second are fast.
  const auto import = [&](double length_m, double time_s) {
    ASSERT_TRUE(Import({StaticFrames(), OdometryMessageAt(10, {}), GreyMessage(10),
                        OdometryMessageAt(10 + time_s, Turned(0, length_m, 0, 0)),
                        OdometryMessageAt(10.1 + time_s, Turned(0, length_m, 0, 0))})
                    .ok());
  };
  for (const auto& [length_m, time_s] : {std::pair(0.4, 0.001), {3.0, 1.0}}) {
    import(length_m, time_s);
    EXPECT_THAT(warnings_, Not(Contains(HasSubstr("jumps")))) << length_m;
  }
  import(1.2, 0.1);
  EXPECT_THAT(warnings_,
              Contains(HasSubstr("odometry jumps 1 times, the first by 1.20 m in 0.100 s at 10.100 s")));
  EXPECT_TRUE(Has("odometry.txt"));
}

TEST_F(ImportedBag, TwoClocksAreNoticed) {
  ASSERT_TRUE(
      Import({StaticFrames(), OdometryMessageAt(5, {}), OdometryMessageAt(6, {}), GreyMessage(1000)}).ok());
  EXPECT_FALSE(Has("odometry.txt"));
  EXPECT_THAT(warnings_,
              Contains(AllOf(HasSubstr("two clocks"), HasSubstr("5.000 to 6.000 s"), HasSubstr("1000.000"))));
}

// The camera's computer is seven hours ahead of the wheels', which recorded both.
TEST_F(ImportedBag, TwoClocksAreBroughtTogetherByWhenMessagesWereRecorded) {
  const auto import = [&](double ahead_s, double recorded_late_s) {
    std::vector<Recorded> messages = {StaticFrames()};
    for (int i = 0; i < 8; ++i) {
      messages.push_back(OdometryMessageAt(100 + i, Turned(0, 2 * i, 0, 0)));
      Recorded image = GreyMessage(100.5 + i + ahead_s);
      image.time_ns = std::llround((100.5 + i) * 1e9 + recorded_late_s * i * 1e9);
      messages.push_back(image);
    }
    ASSERT_TRUE(Import(messages, {.choice = FrameChoice::kAll, .max_time_gap_s = 0.6}).ok());
  };
  import(25200, 0);
  EXPECT_THAT(warnings_,
              Contains(AllOf(HasSubstr("two clocks, 25200.000 s apart"), HasSubstr("same clock"))));
  const std::vector<OdometryLine> odometry = ReadOdometry();
  ASSERT_EQ(odometry.size(), 7u);  // none is after the last image
  EXPECT_EQ(odometry[2].name, "0000025302.500000000.png");
  EXPECT_NEAR(odometry[2].world_from_camera.translation.x(), 5.3, 1e-6);
  // What a driver or a network may take is no other clock ...
  import(-4, 0);
  EXPECT_THAT(warnings_, Not(Contains(HasSubstr("two clocks"))));
  // ... and times of recording that run another way than stamps say nothing.
  import(25200, 0.5);
  EXPECT_THAT(warnings_, Contains(HasSubstr("odometry is left out, as its stamps")));
  EXPECT_FALSE(Has("odometry.txt"));
}

// The wheels' computer, which also turns the mast and has the IMU, counts from when it was switched on; the
// camera's counts from 1970.
TEST_F(ImportedBag, AnImuAndFramesOfAnotherClockAreBroughtToThatOfTheImagesToo) {
  const double ahead_s = 25200;
  std::vector<Recorded> messages = {
      {"/tf_static", kTf, 0, TransformBytes({{"mast", "camera_optical", kOptical}})},
      {"/tf_static", kTf, 0, TransformBytes({{"base_link", "imu_link", Turned(0, 0.1, 0, 0)}})}};
  for (int i = 0; i < 9; ++i) {
    const double time_s = 100 + 0.1 * i;
    const int64_t time_ns = std::llround(time_s * 1e9);
    messages.push_back(OdometryMessageAt(time_s, Turned(0, i, 0, 0)));
    messages.push_back(
        {"/tf", kTf, time_ns, TransformBytes({{"base_link", "mast", Turned(10 * i, 0, 0, 1), time_ns}})});
    messages.push_back(
        {"/imu", "sensor_msgs/msg/Imu", time_ns, ImuBytes({.stamp_ns = time_ns, .accel = {0, 0, 9.8}})});
    Recorded image = GreyMessage(time_s + 0.05 + ahead_s);
    image.time_ns = time_ns + kSecond / 20;
    messages.push_back(image);
  }
  const auto report = Import(messages);
  ASSERT_TRUE(report.ok()) << report.error().message;
  for (const char* source : {"/odom", "/imu", "the frame 'mast' on /tf"}) {
    EXPECT_THAT(warnings_,
                Contains(HasSubstr(fmt::format(
                    "the stamps of /camera/image_raw and of {} are of two clocks, 25200.0", source))));
  }
  EXPECT_EQ(report->num_imu_samples, 9);
  const auto lines = SplitLines(*ReadFile(root_ + "/capture/imu.csv"));
  EXPECT_THAT(std::string(lines.back()), HasSubstr("25300800000000,"));
  const std::vector<OdometryLine> odometry = ReadOdometry();
  ASSERT_EQ(odometry.size(), 8u);  // nothing is after the last image
  EXPECT_EQ(odometry[4].name, "0000025300.450000000.png");
  EXPECT_NEAR(odometry[4].world_from_camera.translation.x(), 4.5, 1e-6);
  const Eigen::Vector3d ahead = odometry[4].world_from_camera.rotation * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(DegFromRad(std::atan2(ahead.y(), ahead.x())), 45, 1e-6);
  // The IMU is seen from where the mast was at the first image: 5 degrees to the left, the base's z up.
  const auto place = ParseNumbers(lines[1].substr(std::string("#imu_on_camera,").size()));
  ASSERT_TRUE(place && place->size() == 7) << lines[1];
  const Eigen::Quaterniond turn((*place)[6], (*place)[3], (*place)[4], (*place)[5]);
  const Eigen::Vector3d imu_x = turn * Eigen::Vector3d::UnitX();
  EXPECT_NEAR(DegFromRad(std::atan2(imu_x.x(), imu_x.z())), 5, 1e-6);
}

// An IMU's driver, and a mast's.
TEST_F(ImportedBag, StampsOfAnImuAndOfFramesThatNoClockGaveAreThoseOfTheRecording) {
  std::vector<Recorded> messages = {
      {"/tf_static", kTf, 0, TransformBytes({{"mast", "camera_optical", kOptical}})}};
  for (int i = 0; i < 9; ++i) {
    const double time_s = 1000 + 0.1 * i;
    const int64_t time_ns = std::llround(time_s * 1e9);
    const auto stamp_ns = [&](int wild, int unset) {
      const int64_t seven_behind_ns = time_ns - 7 * kSecond;
      return i == wild ? 4'200'000'000 * kSecond : i == unset ? 0 : seven_behind_ns;
    };
    messages.push_back({"/imu", "sensor_msgs/msg/Imu", time_ns,
                        ImuBytes({.stamp_ns = stamp_ns(1, 3), .accel = {0, 0, 9.8}})});
    messages.push_back({"/tf", kTf, time_ns,
                        TransformBytes({{"base_link", "mast", Turned(10 * i, 0, 0, 1), stamp_ns(5, 6)}})});
    Recorded odometry = OdometryMessageAt(time_s - 7, {});
    odometry.time_ns = time_ns;
    messages.push_back(odometry);
    messages.push_back({"/i", kImage, time_ns, ImageBytes(Grey(time_s - 7))});
  }
  const auto report = Import(messages, {.choice = FrameChoice::kAll, .max_time_gap_s = 0.05});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->num_imu_samples, 9);
  const auto lines = SplitLines(*ReadFile(root_ + "/capture/imu.csv"));
  EXPECT_THAT(std::string(lines[lines.size() - 8]), HasSubstr("993100000000,"));
  EXPECT_THAT(std::string(lines[lines.size() - 6]), HasSubstr("993300000000,"));
  EXPECT_THAT(warnings_, Contains(HasSubstr("1 messages of the IMU have stamps far from when they were")));
  EXPECT_THAT(warnings_, Contains(HasSubstr("1 messages of the IMU have no stamp")));
  EXPECT_THAT(warnings_, Contains(HasSubstr("1 transforms of 'mast' have stamps far from when they were")));
  EXPECT_THAT(warnings_, Contains(HasSubstr("1 transforms of 'mast' have no stamp")));
  EXPECT_THAT(warnings_, Not(Contains(HasSubstr("two clocks"))));
  const std::vector<OdometryLine> odometry = ReadOdometry();
  ASSERT_EQ(odometry.size(), 9u);
  for (int i = 0; i < 9; ++i) {
    const Eigen::Vector3d ahead = odometry[i].world_from_camera.rotation * Eigen::Vector3d::UnitZ();
    EXPECT_NEAR(DegFromRad(std::atan2(ahead.y(), ahead.x())), 10 * i, 1e-6) << i;
  }
}

// A camera that goes slowly along a wall, a pixel of 160 an image, twenty a second.
TEST_F(ImportedBag, KeyframesAreCloseInTimeWhereOnlyAnImuGivesTheScale) {
  const cv::Mat wall = Wall(400);
  std::vector<Recorded> messages = {StaticFrames()}, imu, odometry;
  for (int i = 0; i < 200; ++i) {
    const int64_t time_ns = 10 * kSecond + i * kSecond / 20;
    messages.push_back(ImageOf(wall(cv::Rect(i, 0, 160, 120)).clone(), time_ns, time_ns));
    imu.push_back(
        {"/imu", "sensor_msgs/msg/Imu", time_ns, ImuBytes({.stamp_ns = time_ns, .accel = {0, 0, 9.8}})});
    odometry.push_back(OdometryMessageAt(1e-9 * static_cast<double>(time_ns), Turned(0, 0.01 * i, 0, 0)));
  }
  const auto longest_s = [&](const std::vector<std::vector<Recorded>>& others, const BagOptions& options) {
    std::vector<Recorded> all = messages;
    for (const auto& other : others) all.insert(all.end(), other.begin(), other.end());
    EXPECT_TRUE(Import(all, options).ok());
    double longest = 0;
    const std::vector<std::string> names = Names();
    for (size_t i = 1; i < names.size(); ++i)
      longest = std::max(longest, std::stod(names[i]) - std::stod(names[i - 1]));
    return longest;
  };
  const double usual_s = longest_s({}, {});
  EXPECT_GT(usual_s, 0.6);
  EXPECT_LE(longest_s({imu}, {}), 0.4 + 1e-6);
  // What odometry or a choice say goes before.
  EXPECT_EQ(longest_s({imu, odometry}, {}), usual_s);
  EXPECT_EQ(longest_s({imu}, {.imu = "none"}), usual_s);
  EXPECT_LE(longest_s({imu, odometry}, {.odometry = "none"}), 0.4 + 1e-6);
  EXPECT_NEAR(longest_s({imu}, {.choice = FrameChoice::kEvery, .every_s = 1}), 1, 1e-6);
}

// A driver whose second message says 2106, and whose fourth says nothing.
TEST_F(ImportedBag, StampsThatNoClockGaveAreThoseOfTheRecording) {
  std::vector<Recorded> messages = {StaticFrames()};
  for (int i = 0; i < 9; ++i) {
    const double time_s = 1000 + i;
    const double stamp_s = i == 1 ? 4.2e9 : i == 3 ? 0 : time_s - 7;  // a clock that is 7 s behind
    messages.push_back({"/i", kImage, std::llround(time_s * 1e9), ImageBytes(Grey(stamp_s))});
    Recorded odometry = OdometryMessageAt(i == 5 ? 2 : time_s - 7, Turned(0, 0.1 * i, 0, 0));
    odometry.time_ns = std::llround(time_s * 1e9);
    messages.push_back(odometry);
  }
  ASSERT_TRUE(Import(messages).ok());
  std::vector<std::string> names;
  for (int i = 0; i < 9; ++i) names.push_back(fmt::format("{:010}.000000000.png", 993 + i));
  EXPECT_EQ(Names(), names);
  EXPECT_THAT(warnings_,
              Contains(HasSubstr("1 images of /i have stamps far from when they were recorded, unlike "
                                 "the others (the first: 4200000000.000 s)")));
  EXPECT_THAT(warnings_, Contains(HasSubstr("1 images of /i have no stamp")));
  EXPECT_THAT(warnings_, Contains(HasSubstr("1 messages of odometry have stamps far from when")));
  const std::vector<OdometryLine> odometry = ReadOdometry();
  ASSERT_EQ(odometry.size(), 9u);
  for (int i = 0; i < 9; ++i)
    EXPECT_NEAR(odometry[i].world_from_camera.translation.x(), 0.3 + 0.1 * i, 1e-6) << i;
}

// A bag that a program made of files, all in the same instant: stamps are all that there is.
TEST_F(ImportedBag, TimesOfRecordingThatSayNothingLeaveStampsAlone) {
  std::vector<Recorded> messages;
  for (int i = 0; i < 40; ++i) messages.push_back({"/i", kImage, 5, ImageBytes(Grey(100 + i))});
  ASSERT_TRUE(Import(messages).ok());
  EXPECT_EQ(Names().size(), 40u);
  EXPECT_EQ(Names().back(), "0000000139.000000000.png");
  EXPECT_THAT(warnings_, Not(Contains(HasSubstr("stamps"))));
}

TEST_F(ImportedBag, OdometryInMillimetresIsNotTakenForMetres) {
  const auto import = [&](double unit) {
    std::vector<Recorded> messages = {StaticFrames()};
    for (int i = 0; i < 10; ++i) {
      messages.push_back(OdometryMessageAt(10 + 0.1 * i, Turned(0, unit * 0.05 * std::max(0, i - 4), 0, 0)));
      messages.push_back(GreyMessage(10 + 0.1 * i));
    }
    ASSERT_TRUE(Import(messages).ok());
  };
  import(1000);  // half a metre a second, after a rest
  EXPECT_FALSE(Has("odometry.txt"));
  EXPECT_THAT(warnings_, Contains(AllOf(HasSubstr("odometry is left out, as it goes at 500 m/s"),
                                        HasSubstr("not in metres"), HasSubstr("0.50 m/s"))));
  import(60);  // 30 m/s: a car
  EXPECT_TRUE(Has("odometry.txt"));
}

TEST_F(ImportedBag, OdometryThatIsNoPoseIsLeftOut) {
  Pose nan = Turned(0, std::numeric_limits<double>::quiet_NaN(), 0, 0);
  Pose zero;
  zero.rotation.coeffs().setZero();
  ASSERT_TRUE(Import({StaticFrames(),
                      OdometryMessageAt(9.9, {}),
                      OdometryMessageAt(10, nan),
                      OdometryMessageAt(10.01, zero),
                      {"/odom", kOdometry, 10 * kSecond, "short"},
                      OdometryMessageAt(10.1, Turned(0, 2, 0, 0)),
                      GreyMessage(10)})
                  .ok());
  ASSERT_EQ(ReadOdometry().size(), 1u);
  EXPECT_NEAR(ReadOdometry()[0].world_from_camera.translation.x(), 1.3, 1e-9);
  EXPECT_THAT(warnings_, Contains(HasSubstr("3 messages of odometry are left out; the first: ")));
  ASSERT_TRUE(Import({StaticFrames(), OdometryMessageAt(10, nan), GreyMessage(10)}).ok());
  EXPECT_FALSE(Has("odometry.txt"));
  EXPECT_THAT(warnings_, Contains(HasSubstr("odometry is left out: no message of /odom can be read")));
}

TEST_F(ImportedBag, ACameraThatSeemsToLookUpIsSaid) {
  // The driver names the camera's body frame (x ahead, z up) instead of the optical one.
  ASSERT_TRUE(
      Import({GreyMessage(1),
              OdometryMessageAt(1, {}),
              {"/tf_static", kTf, 0, TransformBytes({{"base_link", "camera_optical", Turned(0, 0, 0, 1)}})}})
          .ok());
  EXPECT_THAT(warnings_,
              Contains(HasSubstr("by /tf the camera looks up, along z of the frame 'camera_optical'")));
}

}  // namespace
}  // namespace cairn::pipeline
