// Bags as captures: images and cameras.
#include "pipeline/exchange/bags/import_bag.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/capture/keyframes.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "tests/pipeline/exchange/imported_bag.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

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
  const cv::Mat wall = Wall(1200);
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
    messages.push_back(ImageOf(picture, 0, (1 + i) * kSecond));
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
