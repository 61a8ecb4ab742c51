// Bags as captures: images, cameras, odometry.
#include "pipeline/exchange/bags/import_bag.h"

#include <cmath>
#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/text.h"
#include "core/capture/keyframes.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "tests/pipeline/exchange/bag_writers.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr int64_t kSecond = 1'000'000'000;
constexpr char kImage[] = "sensor_msgs/msg/Image";
constexpr char kCompressed[] = "sensor_msgs/msg/CompressedImage";
constexpr char kInfo[] = "sensor_msgs/msg/CameraInfo";
constexpr char kOdometry[] = "nav_msgs/msg/Odometry";
constexpr char kTf[] = "tf2_msgs/msg/TFMessage";

// A grey image of one value, stamped at `time_s`.
RawImage Grey(double time_s, int value = 100, int width = 8, int height = 6) {
  return {.stamp_ns = std::llround(time_s * 1e9),
          .width = width,
          .height = height,
          .pixels = std::string(static_cast<size_t>(width) * height, static_cast<char>(value))};
}
Recorded GreyMessage(double time_s, const std::string& topic = "/camera/image_raw") {
  return {topic, kImage, std::llround(time_s * 1e9), ImageBytes(Grey(time_s))};
}
Pose Turned(double yaw_deg, double x, double y, double z) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(yaw_deg), Eigen::Vector3d::UnitZ())), {x, y, z}};
}
// The optical frame in one whose x axis is ahead and whose z axis is up: x' = -y, y' = -z, z' = x.
const Pose kOptical = {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0, 0, 0}};

Recorded OdometryMessageAt(double time_s, const Pose& pose, const std::string& topic = "/odom") {
  const int64_t time_ns = std::llround(time_s * 1e9);
  return {topic, kOdometry, time_ns, OdometryBytes(time_ns, pose)};
}
// base_link carries camera_link at (0.3, 0, 0.5), which has the optical frame.
Recorded StaticFrames() {
  return {"/tf_static", kTf, 0,
          TransformBytes({{"base_link", "camera_link", Turned(0, 0.3, 0, 0.5)},
                          {"/camera_link", "camera_optical", kOptical}})};
}

struct OdometryLine {
  std::string name;
  Pose world_from_camera;
};

class ImportedBag : public testing::Test {
 protected:
  void SetUp() override {
    root_ =
        testing::TempDir() + "/import_bag_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  Result<BagReport> Import(const std::vector<Recorded>& messages, const BagOptions& options = kAll) {
    fs::remove(root_ + "/bag.db3");
    WriteDb3(root_ + "/bag.db3", messages);
    return ImportFile(root_ + "/bag.db3", options);
  }
  Result<BagReport> ImportFile(const std::string& path, const BagOptions& options = kAll) {
    NoProgress progress;
    auto report = ImportBag(path, options, root_ + "/capture", progress);
    warnings_ = report.ok() ? report->warnings : std::vector<std::string>();
    return report;
  }
  std::string ErrorOf(const std::vector<Recorded>& messages, const BagOptions& options = kAll) {
    const auto report = Import(messages, options);
    return report.ok() ? "imported" : report.error().message;
  }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(root_ + "/capture/images"))
      names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }
  bool Has(const std::string& name) const { return fs::exists(root_ + "/capture/" + name); }
  cv::Mat ReadImage(const std::string& name) const {
    return cv::imread(root_ + "/capture/images/" + name, cv::IMREAD_UNCHANGED);
  }
  std::vector<OdometryLine> ReadOdometry() const {
    const auto text = ReadFile(root_ + "/capture/odometry.txt");
    std::vector<OdometryLine> lines;
    if (!text.ok()) return lines;
    for (const std::string_view line : SplitLines(*text)) {
      const std::vector<std::string> words = SplitWords(line);
      EXPECT_EQ(words.size(), 8u) << line;
      double v[7] = {};
      for (int i = 0; i < 7; ++i) EXPECT_TRUE(ParseNumber(words[i + 1], &v[i]));
      lines.push_back({words[0], {Eigen::Quaterniond(v[6], v[3], v[4], v[5]), {v[0], v[1], v[2]}}});
    }
    return lines;
  }
  static inline const BagOptions kAll = {.choice = FrameChoice::kAll};
  std::string root_;
  std::vector<std::string> warnings_;
};

TEST_F(ImportedBag, HasImagesCameraAndOdometryOfItsOnlyTopics) {
  const auto report = Import({StaticFrames(),
                              {"/camera/camera_info", kInfo, 0, CameraInfoBytes({})},
                              OdometryMessageAt(9.9, Turned(90, 2, 3, 0)),
                              GreyMessage(10),
                              OdometryMessageAt(10.1, Turned(90, 2, 5, 0)),
                              GreyMessage(10.05)});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_THAT(Names(), ElementsAre("0000000010.000000000.png", "0000000010.050000000.png"));
  EXPECT_FALSE(Has("images.txt"));
  EXPECT_TRUE(Has(".cairn-folder"));  // the manifest
  // K, and half a pixel more for the principal point.
  const auto cameras = ReadCamerasText(root_ + "/capture/cameras.txt");
  ASSERT_TRUE(cameras.ok());
  EXPECT_EQ(cameras->at(1).model, CameraModel::kPinhole);
  EXPECT_THAT(cameras->at(1).params, ElementsAre(10, 11, 4.5, 3.5));
  // The robot looks along the world's y; it is at (2, 4) at the first image, the camera 0.3 m ahead.
  const std::vector<OdometryLine> odometry = ReadOdometry();
  ASSERT_EQ(odometry.size(), 2u);
  EXPECT_EQ(odometry[0].name, "0000000010.000000000.png");
  const Pose& pose = odometry[0].world_from_camera;
  EXPECT_LT((pose.translation - Eigen::Vector3d(2, 4.3, 0.5)).norm(), 1e-9);
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d(1, 0, 0)).norm(), 1e-9);
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitY() - Eigen::Vector3d(0, 0, -1)).norm(), 1e-9);
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d(0, 1, 0)).norm(), 1e-9);
  EXPECT_LT((odometry[1].world_from_camera.translation - Eigen::Vector3d(2, 4.8, 0.5)).norm(), 1e-9);
  EXPECT_EQ(report->num_images, 2);
  EXPECT_EQ(report->num_with_odometry, 2);
  EXPECT_EQ(report->num_cameras, 1);
}

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

TEST_F(ImportedBag, IsTheSameFromEveryStorageAndByteOrder) {
  std::vector<std::string> odometry;
  for (const MessageForm form : {MessageForm::kCdr, MessageForm::kCdrBigEndian, MessageForm::kRos1}) {
    SCOPED_TRACE(static_cast<int>(form));
    const std::vector<Recorded> messages = {
        {"/tf_static", kTf, 0, TransformBytes({{"base_link", "camera_optical", kOptical}}, form)},
        {"/camera/camera_info", kInfo, 0, CameraInfoBytes({.d = {0.1, 0.2, 0.3, 0.4, 0.5}}, form)},
        {"/odom", kOdometry, 0, OdometryBytes(10 * kSecond, Turned(30, 1, 2, 0), form)},
        {"/camera/image_raw", kImage, 0, ImageBytes(Grey(10, 77), form)}};
    ASSERT_TRUE(
        WriteFileAtomically(root_ + "/bag.mcap",
                            McapBytes(messages, {.compression = "lz4",
                                                 .encoding = form == MessageForm::kRos1 ? "ros1" : "cdr"}))
            .ok());
    const auto report = ImportFile(root_ + "/bag.mcap");
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_THAT(warnings_, IsEmpty());
    EXPECT_THAT(Names(), ElementsAre("0000000010.000000000.png"));
    EXPECT_EQ(ReadImage(Names()[0]).at<uint8_t>(5, 7), 77);
    EXPECT_THAT(ReadCamerasText(root_ + "/capture/cameras.txt")->at(1).params,
                ElementsAre(10, 11, 4.5, 3.5, 0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0));
    odometry.push_back(*ReadFile(root_ + "/capture/odometry.txt"));
    EXPECT_EQ(odometry.back(), odometry.front());
    if (form != MessageForm::kRos1) continue;
    std::vector<Recorded> of_ros1 = messages;
    for (Recorded& message : of_ros1) message.type.erase(message.type.find("msg/"), 4);
    ASSERT_TRUE(WriteFileAtomically(root_ + "/bag.bag", Ros1BagBytes(of_ros1, {.compression = "lz4"})).ok());
    fs::remove_all(root_ + "/capture");
    ASSERT_TRUE(ImportFile(root_ + "/bag.bag").ok());
    EXPECT_EQ(*ReadFile(root_ + "/capture/odometry.txt"), odometry.front());
    EXPECT_EQ(ReadImage(Names()[0]).at<uint8_t>(5, 7), 77);
  }
}

TEST_F(ImportedBag, PixelsOfEveryEncodingHaveTheirColour) {
  // Two pixels, blue and green: grey of 29 and 150.
  const struct {
    const char* encoding;
    std::string pixels;
  } kColours[] = {
      {"bgr8", {'\xff', 0, 0, 0, '\xff', 0}},
      {"rgb8", {0, 0, '\xff', 0, '\xff', 0}},
      {"bgra8", {'\xff', 0, 0, 9, 0, '\xff', 0, 9}},
      {"rgba8", {0, 0, '\xff', 9, 0, '\xff', 0, 9}},
  };
  for (const auto& [encoding, pixels] : kColours) {
    SCOPED_TRACE(encoding);
    const std::string bytes =
        ImageBytes({.stamp_ns = kSecond, .width = 2, .height = 1, .encoding = encoding, .pixels = pixels});
    ASSERT_TRUE(Import({{"/i", kImage, 0, bytes}}).ok());
    const cv::Mat image = ReadImage(Names()[0]);
    ASSERT_EQ(image.type(), CV_8UC3);
    EXPECT_EQ(image.at<cv::Vec3b>(0, 0), cv::Vec3b(255, 0, 0));
    EXPECT_EQ(image.at<cv::Vec3b>(0, 1), cv::Vec3b(0, 255, 0));
  }
  // Grey as YUV: U Y V Y, or Y U Y V.  16 is black, 235 white.
  for (const auto& [encoding, pixels] :
       {std::pair<const char*, std::string>{"yuv422", {'\x80', 16, '\x80', '\xeb'}},
        std::pair<const char*, std::string>{"yuv422_yuy2", {16, '\x80', '\xeb', '\x80'}}}) {
    const std::string bytes =
        ImageBytes({.stamp_ns = kSecond, .width = 2, .height = 1, .encoding = encoding, .pixels = pixels});
    ASSERT_TRUE(Import({{"/i", kImage, 0, bytes}}).ok());
    EXPECT_EQ(ReadImage(Names()[0]).at<cv::Vec3b>(0, 0), cv::Vec3b(0, 0, 0));
    EXPECT_EQ(ReadImage(Names()[0]).at<cv::Vec3b>(0, 1), cv::Vec3b(255, 255, 255));
  }
}

TEST_F(ImportedBag, BayerPatternsAreNamedAfterTheirFirstPixels) {
  // All red pixels are bright: the picture is red, whichever place they have in the pattern.
  const std::map<std::string, std::pair<int, int>> red_at = {
      {"bayer_rggb8", {0, 0}}, {"bayer_grbg8", {0, 1}}, {"bayer_gbrg8", {1, 0}}, {"bayer_bggr8", {1, 1}}};
  for (const auto& [encoding, place] : red_at) {
    SCOPED_TRACE(encoding);
    cv::Mat pattern = cv::Mat::zeros(8, 8, CV_8UC1);
    for (int row = place.first; row < 8; row += 2) {
      for (int col = place.second; col < 8; col += 2) pattern.at<uint8_t>(row, col) = 200;
    }
    const std::string pixels(pattern.ptr<char>(), 64);
    ASSERT_TRUE(
        Import(
            {{"/i", kImage, 0,
              ImageBytes(
                  {.stamp_ns = kSecond, .width = 8, .height = 8, .encoding = encoding, .pixels = pixels})}})
            .ok());
    const cv::Vec3b middle = ReadImage(Names()[0]).at<cv::Vec3b>(4, 4);
    EXPECT_EQ(middle[2], 200);
    EXPECT_EQ(middle[0], 0);
  }
}

TEST_F(ImportedBag, CompressedImagesAreCopiedAsTheyAre) {
  cv::Mat scene(48, 64, CV_8UC3);
  cv::randu(scene, 0, 255);
  std::vector<uint8_t> jpeg, png;
  cv::imencode(".jpg", scene, jpeg);
  cv::imencode(".png", scene, png);
  const std::string jpeg_text(jpeg.begin(), jpeg.end()), png_text(png.begin(), png.end());
  const std::string topic = "/camera/image_raw/compressed";
  const auto report =
      Import({{"/camera/camera_info", kInfo, 0, CameraInfoBytes({.width = 64, .height = 48})},
              {topic, kCompressed, 1, CompressedImageBytes(kSecond, "jpeg", jpeg_text)},
              {topic, kCompressed, 2, CompressedImageBytes(2 * kSecond, "png", png_text)},
              {topic, kCompressed, 3, CompressedImageBytes(3 * kSecond, "jpeg", jpeg_text.substr(0, 500))},
              {topic, kCompressed, 4, CompressedImageBytes(4 * kSecond, "webp", "RIFF")}});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_THAT(Names(), ElementsAre("0000000001.000000000.jpg", "0000000002.000000000.png"));
  EXPECT_EQ(*ReadFile(root_ + "/capture/images/" + Names()[0]), jpeg_text);
  EXPECT_EQ(*ReadFile(root_ + "/capture/images/" + Names()[1]), png_text);
  EXPECT_TRUE(Has("cameras.txt"));  // beside the topic without /compressed
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("2 images of /camera/image_raw/compressed are left out")));
}

TEST_F(ImportedBag, TopicsAreAskedForWhereSeveralFit) {
  const std::vector<Recorded> two = {GreyMessage(1, "/left/image_raw"), GreyMessage(1, "/right/image_raw"),
                                     OdometryMessageAt(1, {})};
  const std::string message = ErrorOf(two);
  EXPECT_THAT(message, HasSubstr("several topics have images; choose one with --topic /left/image_raw, or in "
                                 "a recipe's [[capture]] with topic = \"/left/image_raw\"\n"));
  EXPECT_THAT(message, HasSubstr("/right/image_raw  sensor_msgs/Image         1           8 x 6  mono8"));
  EXPECT_THAT(message, HasSubstr("/odom             nav_msgs/Odometry         1\n"));
  EXPECT_FALSE(Has(""));
  auto report = Import(two, {.topic = "/right/image_raw", .choice = FrameChoice::kAll});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->topic, "/right/image_raw");
  EXPECT_TRUE(Import(two, {.topic = "right/image_raw", .choice = FrameChoice::kAll}).ok());
  EXPECT_THAT(ErrorOf(two, {.topic = "/middle"}),
              AllOf(HasSubstr("no topic /middle"), HasSubstr("/left/image_raw")));
  EXPECT_THAT(ErrorOf(two, {.topic = "/odom"}),
              HasSubstr("the topic /odom has no images, but nav_msgs/Odometry"));

  const std::vector<Recorded> wheels = {GreyMessage(1), StaticFrames(),
                                        OdometryMessageAt(1, Turned(0, 1, 0, 0), "/wheels"),
                                        OdometryMessageAt(1, Turned(0, 5, 0, 0), "/visual")};
  EXPECT_THAT(ErrorOf(wheels), HasSubstr("several topics have odometry; choose one with --odometry none, or "
                                         "--odometry /visual, or in a recipe's [[capture]] with odometry = "
                                         "\"/visual\"\n"));
  ASSERT_TRUE(Import(wheels, {.odometry = "/wheels", .choice = FrameChoice::kAll}).ok());
  EXPECT_NEAR(ReadOdometry().at(0).world_from_camera.translation.x(), 1.3, 1e-9);
  ASSERT_TRUE(Import(wheels, {.odometry = "none", .choice = FrameChoice::kAll}).ok());
  EXPECT_FALSE(Has("odometry.txt"));
  EXPECT_THAT(ErrorOf(wheels, {.odometry = "/tf_static"}), HasSubstr("has no odometry"));
}

TEST_F(ImportedBag, TheTableOfTopicsHasRatesAndSizes) {
  cv::Mat picture(30, 40, CV_8UC1, cv::Scalar(90));
  std::vector<uchar> jpeg;
  cv::imencode(".jpg", picture, jpeg);
  const std::string file(jpeg.begin(), jpeg.end());
  std::vector<Recorded> messages;
  for (int i = 0; i < 5; ++i) {  // five in two seconds are two a second and a bit; the order does not matter
    const int64_t time_ns = (i == 1 ? 4 : i == 4 ? 1 : i) * kSecond / 2;
    messages.push_back({"/b/compressed", kCompressed, time_ns, CompressedImageBytes(time_ns, "jpeg", file)});
  }
  messages.push_back({"/a", kImage, 3, ImageBytes(Grey(1))});
  messages.push_back({"/c", kCompressed, 3, CompressedImageBytes(1, "jpeg", "damaged")});
  const std::string message = ErrorOf(messages);
  EXPECT_THAT(
      message,
      HasSubstr("\n  topic          type                         messages       Hz  size     encoding\n"));
  EXPECT_THAT(
      message,
      HasSubstr("\n  /a             sensor_msgs/Image                   1           8 x 6    mono8\n"));
  EXPECT_THAT(
      message,
      HasSubstr("\n  /b/compressed  sensor_msgs/CompressedImage         5      2.0  40 x 30  jpeg\n"));
  EXPECT_THAT(
      message,
      testing::EndsWith("\n  /c             sensor_msgs/CompressedImage         1                    jpeg"));
}

TEST_F(ImportedBag, ImagesThatWereCompressedTooAreTakenAsTheyWere) {
  cv::Mat picture(6, 8, CV_8UC1, cv::Scalar(90));
  std::vector<uchar> jpeg;
  cv::imencode(".jpg", picture, jpeg);
  const auto compressed = [&](int64_t i, const std::string& topic) {
    return Recorded{topic, kCompressed, i * kSecond,
                    CompressedImageBytes(i * kSecond, "jpeg", std::string(jpeg.begin(), jpeg.end()))};
  };
  const std::string twin = "/camera/image_raw/compressed";
  const std::vector<Recorded> both = {GreyMessage(1), compressed(1, twin), GreyMessage(2),
                                      compressed(2, twin)};
  auto report = Import(both, {.choice = FrameChoice::kAll});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->topic, "/camera/image_raw");
  EXPECT_THAT(warnings_,
              testing::Contains(HasSubstr("the images of /camera/image_raw are taken, not those of "
                                          "/camera/image_raw/compressed, of which there are as many")));
  // The other one where it is asked for, which needs no warning.
  report = Import(both, {.topic = twin, .choice = FrameChoice::kAll});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->topic, twin);
  EXPECT_THAT(warnings_, testing::Not(testing::Contains(HasSubstr("as many"))));
  // Not where the former cannot be read, ...
  EXPECT_THAT(ErrorOf({{"/camera/image_raw", kImage, 1, "?"}, compressed(1, twin)}),
              HasSubstr("several topics"));
  // ... some were lost, or it is another camera.
  EXPECT_THAT(ErrorOf({GreyMessage(1), compressed(1, twin), compressed(2, twin)}),
              HasSubstr("several topics"));
  EXPECT_THAT(ErrorOf({GreyMessage(1), compressed(1, "/back/image_raw/compressed")}),
              HasSubstr("several topics"));
}

TEST_F(ImportedBag, DepthIsNoPicture) {
  RawImage depth = Grey(1);
  depth.encoding = "32FC1";
  const Recorded message = {"/depth/image_rect", kImage, 1, ImageBytes(depth)};
  EXPECT_TRUE(Import({GreyMessage(1), message}).ok());
  EXPECT_THAT(ErrorOf({message}), HasSubstr("no topic has images"));
  EXPECT_THAT(ErrorOf({message}, {.topic = "/depth/image_rect"}),
              AllOf(HasSubstr("none of the 1 images"), HasSubstr("its encoding is '32FC1', known are")));
}

TEST_F(ImportedBag, WithoutImagesOrMessagesIsSaid) {
  EXPECT_THAT(ErrorOf({OdometryMessageAt(1, {})}),
              AllOf(HasSubstr("no topic has images"), HasSubstr("/odom")));
  EXPECT_THAT(ErrorOf({}), HasSubstr("the bag has no messages"));
  EXPECT_THAT(ErrorOf({{"/i", kImage, 1, "?"}}),
              HasSubstr("no message of /i can be read; the first: 1 bytes"));
  EXPECT_FALSE(Has(""));
}

TEST_F(ImportedBag, WithoutCalibrationHasNoCameras) {
  ASSERT_TRUE(Import({GreyMessage(1)}).ok());
  EXPECT_FALSE(Has("cameras.txt"));
  EXPECT_FALSE(Has("odometry.txt"));
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("no camera_info that belongs to /camera/image_raw")));
  // Not calibrated; of another size; a model that is not known; one that is not a message.
  CameraInfoFields fields;
  fields.k = {};
  const auto with = [&](const std::string& info) {
    EXPECT_TRUE(Import({GreyMessage(1), {"/camera/camera_info", kInfo, 0, info}}).ok());
    EXPECT_FALSE(Has("cameras.txt"));
    return warnings_.empty() ? "" : warnings_[0];
  };
  EXPECT_THAT(with(CameraInfoBytes(fields)), HasSubstr("the camera is not calibrated"));
  EXPECT_THAT(with(CameraInfoBytes({.width = 16, .height = 12})),
              HasSubstr("it is of 16 x 12 px, but the images have 8 x 6"));
  EXPECT_THAT(with(CameraInfoBytes({.model = "omni", .d = {1, 2, 3, 4}})),
              HasSubstr("distortion model is 'omni'"));
  EXPECT_THAT(with("nothing"), HasSubstr("can be read"));
  // A camera that is asked for comes first.
  ASSERT_TRUE(Import({GreyMessage(1)}, {.camera = "PINHOLE,8,6,5,5,4,3", .choice = FrameChoice::kAll}).ok());
  EXPECT_THAT(ReadCamerasText(root_ + "/capture/cameras.txt")->at(1).params, ElementsAre(5, 5, 4, 3));
  EXPECT_THAT(ErrorOf({GreyMessage(1)}, {.camera = "PINHOLE,9,6,5,5,4,3", .choice = FrameChoice::kAll}),
              HasSubstr("--camera has 9 x 6 px, but the images have 8 x 6"));
}

TEST_F(ImportedBag, TheCameraInfoOfAnotherCameraIsNotTaken) {
  // Two cameras, of which one was recorded without camera_info; frames tell whose it is.
  RawImage left = Grey(1);
  left.frame = "left_optical";
  ASSERT_TRUE(Import({{"/left/image_raw", kImage, 1, ImageBytes(left)},
                      {"/right/camera_info", kInfo, 0, CameraInfoBytes({})}})
                  .ok());
  EXPECT_FALSE(Has("cameras.txt"));
  ASSERT_TRUE(
      Import({GreyMessage(1, "/picture"), {"/elsewhere/camera_info", kInfo, 0, CameraInfoBytes({})}}).ok());
  EXPECT_TRUE(Has("cameras.txt"));
  // Of two in the same frame nothing says which it is.
  ASSERT_TRUE(Import({GreyMessage(1, "/picture"),
                      {"/one/camera_info", kInfo, 0, CameraInfoBytes({})},
                      {"/two/camera_info", kInfo, 0, CameraInfoBytes({})}})
                  .ok());
  EXPECT_FALSE(Has("cameras.txt"));
}

TEST_F(ImportedBag, RectifiedImagesHaveTheCameraOfP) {
  const CameraInfoFields fields = {.d = {0.1, 0.2, 0.3, 0.4, 0.5}};
  ASSERT_TRUE(Import({GreyMessage(1, "/camera/image_rect"),
                      {"/camera/camera_info", kInfo, 0, CameraInfoBytes(fields)}})
                  .ok());
  const Camera camera = ReadCamerasText(root_ + "/capture/cameras.txt")->at(1);
  EXPECT_EQ(camera.model, CameraModel::kPinhole);
  EXPECT_THAT(camera.params, ElementsAre(9, 9, 4, 3));
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

TEST_F(ImportedBag, WithoutStampsTimesAreThoseOfTheRecording) {
  ASSERT_TRUE(Import({{"/i", kImage, 5 * kSecond, ImageBytes(Grey(0))},
                      {"/i", kImage, 6 * kSecond, ImageBytes(Grey(0))}})
                  .ok());
  EXPECT_THAT(Names(), ElementsAre("0000000005.000000000.png", "0000000006.000000000.png"));
  EXPECT_THAT(warnings_, Contains(HasSubstr("2 images of /i have no stamp")));
}

TEST_F(ImportedBag, ImagesOfAnotherSizeOrAnEarlierTimeAreLeftOut) {
  ASSERT_TRUE(Import({GreyMessage(2),
                      {"/camera/image_raw", kImage, 0, ImageBytes(Grey(3, 100, 4, 2))},
                      GreyMessage(1),
                      GreyMessage(2),
                      GreyMessage(4)})
                  .ok());
  EXPECT_THAT(Names(), ElementsAre("0000000002.000000000.png", "0000000004.000000000.png"));
  EXPECT_THAT(warnings_,
              Contains(HasSubstr("1 images of /camera/image_raw are left out: they are of another size "
                                 "(4 x 2 pixels) than most (8 x 6)")));
  EXPECT_THAT(warnings_,
              Contains(HasSubstr("2 images of /camera/image_raw are left out, whose stamps are not after")));
}

// As from a camera whose driver sets the size a moment after it began.
TEST_F(ImportedBag, AFirstImageOfAnotherSizeIsTheOneThatIsLeftOut) {
  ASSERT_TRUE(Import({{"/camera/image_raw", kImage, kSecond, ImageBytes(Grey(1, 100, 4, 2))},
                      {"/camera/camera_info", kInfo, 0, CameraInfoBytes({})},
                      GreyMessage(2),
                      GreyMessage(3)})
                  .ok());
  EXPECT_THAT(Names(), ElementsAre("0000000002.000000000.png", "0000000003.000000000.png"));
  EXPECT_THAT(warnings_,
              ElementsAre(HasSubstr("1 images of /camera/image_raw are left out: they are of another "
                                    "size (4 x 2 pixels) than most (8 x 6)")));
  EXPECT_TRUE(Has("cameras.txt"));
  const auto jpeg = [](int time_s, int width) {
    std::vector<uchar> bytes;
    cv::imencode(".jpg", cv::Mat(6, width, CV_8UC1, cv::Scalar(100)), bytes);
    return Recorded{"/i/compressed", kCompressed, time_s * kSecond,
                    CompressedImageBytes(time_s * kSecond, "jpeg",
                                         {reinterpret_cast<char*>(bytes.data()), bytes.size()})};
  };
  ASSERT_TRUE(Import({jpeg(1, 16), jpeg(2, 8), jpeg(3, 8)}).ok());
  EXPECT_THAT(Names(), ElementsAre("0000000002.000000000.jpg", "0000000003.000000000.jpg"));
}

TEST_F(ImportedBag, ImagesThatCannotBeReadAreLeftOut) {
  RawImage few = Grey(2), narrow = Grey(3), unknown = Grey(4), none = Grey(5), huge = Grey(6);
  few.pixels.resize(47);
  few.step = 8;
  narrow.step = 7;
  unknown.encoding = "mono12";
  none.width = 0;
  huge.width = huge.height = 1 << 30;
  std::vector<Recorded> messages = {GreyMessage(1)};
  for (const RawImage& image : {few, narrow, unknown, none, huge})
    messages.push_back({"/camera/image_raw", kImage, image.stamp_ns, ImageBytes(image)});
  // The length of the pixels says more than there is.
  std::string cut = ImageBytes(Grey(7));
  messages.push_back({"/camera/image_raw", kImage, 0, cut.substr(0, cut.size() - 1)});
  ASSERT_TRUE(Import(messages).ok());
  EXPECT_THAT(Names(), ElementsAre("0000000001.000000000.png"));
  EXPECT_THAT(warnings_,
              Contains(AllOf(HasSubstr("6 images of /camera/image_raw are left out, as they cannot be read"),
                             HasSubstr("found 47 bytes in rows of 8"))));
}

TEST_F(ImportedBag, ImagesAreChosenByTime) {
  std::vector<Recorded> messages;
  for (int i = 0; i < 10; ++i) messages.push_back(GreyMessage(1 + 0.1 * i));
  ASSERT_TRUE(Import(messages, {.choice = FrameChoice::kEvery, .every_s = 0.35}).ok());
  EXPECT_THAT(Names(), ElementsAre("0000000001.000000000.png", "0000000001.400000000.png",
                                   "0000000001.800000000.png"));
  EXPECT_THAT(ErrorOf(messages, {}),
              HasSubstr("no keyframe among 10 images of /camera/image_raw: they are blank"));
}

// Images are written when the chooser has decided, often some images later.
TEST_F(ImportedBag, KeyframesAreThoseOfTheChooser) {
  // A camera slides along a wall, three pixels an image; three of four images are less sharp.
  cv::Mat wall(120, 1200, CV_8UC1);
  cv::theRNG().state = 1;
  cv::randu(wall, 0, 255);
  cv::GaussianBlur(wall, wall, {}, 2);
  cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
  const auto view = [&](int i) {
    cv::Mat picture = wall(cv::Rect(3 * i, 0, 160, 120)).clone();
    if (i % 4 != 0) cv::GaussianBlur(picture, picture, {}, 1);
    return picture;
  };
  std::vector<Recorded> messages;
  KeyframeChooser chooser;
  std::vector<int64_t> expected;
  int num_late = 0;
  for (int i = 0; i < 300; ++i) {
    const cv::Mat picture = view(i);
    messages.push_back({"/i", kImage, 0,
                        ImageBytes({.stamp_ns = (1 + i) * kSecond,
                                    .width = 160,
                                    .height = 120,
                                    .pixels = std::string(picture.ptr<char>(), picture.total())})});
    for (const int64_t keyframe : chooser.Add(i, picture)) {
      expected.push_back(keyframe);
      num_late += keyframe < i;
    }
  }
  for (const int64_t keyframe : chooser.Finish()) expected.push_back(keyframe);
  ASSERT_GT(num_late, 5);
  const auto report = Import(messages, {});
  ASSERT_TRUE(report.ok()) << report.error().message;
  const std::vector<std::string> names = Names();
  ASSERT_EQ(names.size(), expected.size());
  EXPECT_EQ(report->num_images, static_cast<int64_t>(expected.size()));
  for (size_t k = 0; k < names.size(); ++k) {
    EXPECT_EQ(names[k], fmt::format("{:010}.000000000.png", expected[k] + 1));
    EXPECT_EQ(cv::norm(ReadImage(names[k]), view(static_cast<int>(expected[k])), cv::NORM_INF), 0)
        << names[k];
  }
}

TEST_F(ImportedBag, IsWrittenAgainWithTheSameBytes) {
  const std::vector<Recorded> messages = {StaticFrames(), OdometryMessageAt(1, {}), GreyMessage(1)};
  ASSERT_TRUE(Import(messages).ok());
  const std::string manifest = *ReadFile(root_ + "/capture/.cairn-folder");
  ASSERT_TRUE(Import(messages).ok());
  EXPECT_EQ(*ReadFile(root_ + "/capture/.cairn-folder"), manifest);
}

TEST_F(ImportedBag, ATruncatedBagGivesItsWholeImagesAndSaysSo) {
  const std::string bytes = McapBytes({GreyMessage(1), GreyMessage(2), GreyMessage(3), GreyMessage(4)});
  ASSERT_TRUE(WriteFileAtomically(root_ + "/bag.mcap", bytes.substr(0, bytes.size() * 2 / 3)).ok());
  ASSERT_TRUE(ImportFile(root_ + "/bag.mcap").ok());
  EXPECT_THAT(Names(), ElementsAre("0000000001.000000000.png", "0000000002.000000000.png"));
  EXPECT_THAT(warnings_, Contains(HasSubstr("ends in the middle of a record")));
}

}  // namespace
}  // namespace cairn::pipeline
