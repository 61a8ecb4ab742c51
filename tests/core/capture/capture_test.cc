#include "core/capture/capture.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "tests/core/capture/exif_jpeg.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class CaptureTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ =
        testing::TempDir() + "/capture_test_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    fs::create_directories(root_ + "/images");
    Write("cameras.txt", "# comment\n1 PINHOLE 640 480 525 525 320 240\n");
  }
  void Write(const std::string& name, const std::string& text) {
    fs::create_directories(fs::path(root_ + "/" + name).parent_path());
    ASSERT_TRUE(WriteFileAtomically(root_ + "/" + name, text).ok());
  }
  void AddFiles(const std::vector<std::string>& names) {
    for (const std::string& name : names) Write("images/" + name, "x");
  }
  std::string root_;
};

TEST_F(CaptureTest, ReadsImagesWithAndWithoutSecondLines) {
  AddFiles({"a.jpg", "b c.jpg", "d.jpg"});
  Write("images.txt",
        "# header\n1 1 0 0 0 0.5 0 0 1 b c.jpg\n10.5 20.5 -1 30 40 7\n"  // a points line as COLMAP writes it
        "2 1 0 0 0 1 0 0 1 a.jpg\n3 1 0 0 0 2 0 0 1 d.jpg\n");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  ASSERT_EQ(capture->images.size(), 3u);
  EXPECT_EQ(capture->images[0].name, "a.jpg");
  EXPECT_EQ(capture->images[1].name, "b c.jpg");
  EXPECT_EQ(capture->images[1].cam_from_world->translation.x(), 0.5);
  EXPECT_TRUE(capture->has_poses);
}

TEST_F(CaptureTest, BadPosesAndMissingFilesAreRejectsWithReasons) {
  AddFiles({"a.jpg", "b.jpg", "c.jpg", "d.jpg"});
  Write("images.txt",
        "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 nan 0 0 0 0 0 0 1 b.jpg\n\n3 2 0 0 0 0 0 0 1 c.jpg\n\n4 1 0 0 0 0 0 0 "
        "9 d.jpg\n\n"
        "5 1 0 0 0 0 0 0 1 e.jpg\n");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  ASSERT_EQ(capture->images.size(), 1u);
  std::map<std::string, std::string> reasons;
  for (const Reject& reject : capture->rejects) reasons[reject.name] = reject.reason;
  EXPECT_THAT(reasons["b.jpg"], HasSubstr("images.txt:3: pose is not finite"));
  EXPECT_THAT(reasons["c.jpg"], HasSubstr("quaternion of norm 2, expected 1"));
  EXPECT_THAT(reasons["d.jpg"], HasSubstr("camera 9 is not in"));
  EXPECT_THAT(reasons["e.jpg"], HasSubstr("no such file"));
}

TEST_F(CaptureTest, AnImageListedTwiceIsAnError) {
  AddFiles({"a.jpg"});
  Write("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 1 0 0 1 a.jpg\n");
  const auto capture = ReadCapture(root_);
  ASSERT_FALSE(capture.ok());
  EXPECT_EQ(capture.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(capture.error().message, HasSubstr("images.txt: lists 'a.jpg' twice"));
}

TEST_F(CaptureTest, NamesMayHaveBlanksOtherAlphabetsAndFolders) {
  fs::create_directories(root_ + "/images/a");
  fs::create_directories(root_ + "/images/b");
  AddFiles({"a/1.jpg", "b/1.jpg", "kök  och rum.jpg", "図書館.jpg", "x.jpg"});
  // The numbers before a name are the same ones again and again: the name must not be looked for by them.
  Write("images.txt",
        "1 1 0 0 0 0 0 0 1 a/1.jpg\n\n2 1 0 0 0 1 1 0 1 b/1.jpg\n\n3 1 0 0 0 0 0 0 1  kök  och rum.jpg \n\n"
        "4 1 0 0 0 1 0 1 1 図書館.jpg\r\n\n5 1 0 0 0 1 1 0 1 x.jpg\n");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  std::vector<std::string> names;
  for (const CaptureImage& image : capture->images) names.push_back(image.name);
  EXPECT_THAT(names, testing::ElementsAre("a/1.jpg", "b/1.jpg", "kök  och rum.jpg", "x.jpg", "図書館.jpg"));
  EXPECT_THAT(capture->rejects, testing::IsEmpty());
}

TEST_F(CaptureTest, LinksToFilesAreFollowedAndBrokenOnesAreRejected) {
  AddFiles({"real.jpg"});
  fs::create_symlink("real.jpg", root_ + "/images/link.jpg");
  fs::create_symlink("nowhere.jpg", root_ + "/images/broken.jpg");
  fs::create_directories(root_ + "/images/folder.jpg");
  Write("images.txt",
        "1 1 0 0 0 0 0 0 1 real.jpg\n\n2 1 0 0 0 0 0 0 1 link.jpg\n\n3 1 0 0 0 0 0 0 1 broken.jpg\n\n"
        "4 1 0 0 0 0 0 0 1 folder.jpg\n");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_EQ(capture->images.size(), 2u);
  EXPECT_THAT(capture->warnings, testing::IsEmpty());
  std::map<std::string, std::string> reasons;
  for (const Reject& reject : capture->rejects) reasons[reject.name] = reject.reason;
  EXPECT_THAT(reasons["broken.jpg"], HasSubstr("a link to a file that does not exist"));
  EXPECT_THAT(reasons["folder.jpg"], HasSubstr("not a file"));
}

TEST_F(CaptureTest, PanoramasNeedNoParametersAndMayRepeatTheirSize) {
  AddFiles({"a.jpg"});
  Write("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n");
  for (const char* line : {"1 EQUIRECTANGULAR 4096 2048\n", "1 EQUIRECTANGULAR 4096 2048 4096 2048\n"}) {
    Write("cameras.txt", line);
    const auto capture = ReadCapture(root_);
    ASSERT_TRUE(capture.ok()) << capture.error().message;
    EXPECT_EQ(capture->cameras.at(1).model, CameraModel::kEquirectangular);
    EXPECT_TRUE(capture->cameras.at(1).params.empty());
  }
  Write("cameras.txt", "1 EQUIRECTANGULAR 4096 2048 500\n");
  EXPECT_FALSE(ReadCapture(root_).ok());
}

TEST_F(CaptureTest, QueriesAreHeldOutAndStrayFilesAreWarnedOf) {
  AddFiles({"a.jpg", "q.jpg", "stray.jpg"});
  Write("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n");
  Write("queries.txt", "1 1 0 0 0 0 0 0 1 q.jpg\n");
  const auto capture = ReadCapture(root_);
  ASSERT_EQ(capture->images.size(), 1u);
  ASSERT_EQ(capture->queries.size(), 1u);
  EXPECT_THAT(capture->warnings,
              testing::ElementsAre(HasSubstr("stray.jpg: in neither images.txt nor queries.txt")));
}

TEST_F(CaptureTest, BrokenListsNameFileAndLine) {
  AddFiles({"a.jpg"});
  Write("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0\n");
  EXPECT_THAT(ReadCapture(root_).error().message, HasSubstr("images.txt:3: expected IMAGE_ID QW"));
  Write("images.txt", "1 1 0 0 zero 0 0 0 1 a.jpg\n");
  EXPECT_THAT(ReadCapture(root_).error().message,
              HasSubstr("images.txt:1: a pose or camera id is not a number"));
  Write("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n");
  Write("cameras.txt", "1 SPHERE 640 480 1\n");
  const auto capture = ReadCapture(root_);
  EXPECT_EQ(capture.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(capture.error().message, HasSubstr("cameras.txt:1: unknown camera model 'SPHERE'; known are"));
}

// Images of 3 x 2 and of 2 x 3 pixels.
constexpr const char* kWide = "P5\n3 2\n255\nabcdef";
constexpr const char* kHigh = "P5\n2 3\n255\nabcdef";

class CaptureWithoutPoses : public CaptureTest {
 protected:
  void SetUp() override {
    CaptureTest::SetUp();
    Write("images/a.pgm", kWide);
    Write("images/deep/B.PGM", kHigh);
  }
};

TEST_F(CaptureWithoutPoses, CamerasOfTheListAreThoseOfImagesOfTheirSize) {
  Write("cameras.txt", "7 PINHOLE 3 2 9 8 1.5 1\n4 OPENCV 2 3 6 7 1 1.5 0.1 0 0 0\n5 PINHOLE 9 9 9 9 4 4\n");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_FALSE(capture->has_poses);
  EXPECT_THAT(capture->warnings, testing::IsEmpty());
  ASSERT_EQ(capture->images.size(), 2u);
  EXPECT_EQ(capture->images[0].name, "a.pgm");
  EXPECT_EQ(capture->images[0].camera_id, 7u);
  EXPECT_EQ(capture->images[1].name, "deep/B.PGM");
  EXPECT_EQ(capture->images[1].camera_id, 4u);
  EXPECT_FALSE(capture->images[0].cam_from_world.has_value());
  EXPECT_THAT(capture->cameras.at(7).params, testing::ElementsAre(9, 8, 1.5, 1));
  EXPECT_EQ(capture->cameras.at(4).model, CameraModel::kOpenCv);
  EXPECT_TRUE(capture->cameras.at(7).has_focal_prior);
}

TEST_F(CaptureWithoutPoses, ImagesOfASizeThatNoCameraHasAreRejected) {
  Write("cameras.txt", "1 PINHOLE 3 2 9 8 1.5 1\n");
  auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_EQ(capture->images.size(), 1u);
  ASSERT_EQ(capture->rejects.size(), 1u);
  EXPECT_EQ(capture->rejects[0].name, "deep/B.PGM");
  EXPECT_THAT(capture->rejects[0].reason, HasSubstr("has 2 x 3 pixels, as no camera of " + root_));
  Write("cameras.txt", "1 PINHOLE 30 20 9 8 1.5 1\n");
  capture = ReadCapture(root_);
  EXPECT_EQ(capture.error().code, ErrorCode::kNoData);
  EXPECT_THAT(capture.error().message, HasSubstr("the first of 2 rejected: the image has 3 x 2 pixels"));
}

TEST_F(CaptureWithoutPoses, SeveralCamerasOfOneSizeMustAgree) {
  Write("cameras.txt", "2 PINHOLE 3 2 9 8 1.5 1\n1 PINHOLE 3 2 9 8 1.5 1\n");
  EXPECT_EQ(ReadCapture(root_)->images[0].camera_id, 1u);
  Write("cameras.txt", "1 PINHOLE 3 2 9 8 1.5 1\n2 PINHOLE 3 2 9 9 1.5 1\n");
  auto capture = ReadCapture(root_);
  EXPECT_EQ(capture.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(capture.error().message, HasSubstr("cameras 1 and 2 are both 3 x 2, and without images.txt"));
  Write("cameras.txt", "1 SIMPLE_PINHOLE 3 2 9 1.5 1\n2 FOV 3 2 9 9 1.5 1 0.5\n");
  EXPECT_EQ(ReadCapture(root_).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(CaptureWithoutPoses, BrokenCamerasAreErrorsAndNotGuessed) {
  Write("cameras.txt", "# none\n");
  EXPECT_THAT(ReadCapture(root_).error().message, HasSubstr("cameras.txt: lists no camera"));
  Write("cameras.txt", "1 PINHOLE three 2 9 8 1.5 1\n");
  EXPECT_THAT(ReadCapture(root_).error().message,
              HasSubstr("cameras.txt:1: image size 'three x 2' is not two positive integers"));
  fs::remove(root_ + "/cameras.txt");
  fs::create_symlink("nowhere", root_ + "/cameras.txt");
  EXPECT_THAT(ReadCapture(root_).error().message,
              HasSubstr("cameras.txt: a link to a file that does not exist"));
}

TEST_F(CaptureWithoutPoses, WithoutCamerasTheyAreGuessedForEachSize) {
  fs::remove(root_ + "/cameras.txt");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_EQ(capture->images.size(), 2u);
  EXPECT_EQ(capture->cameras.size(), 2u);
  EXPECT_NE(capture->images[0].camera_id, capture->images[1].camera_id);
  EXPECT_FALSE(capture->cameras.begin()->second.has_focal_prior);
  EXPECT_THAT(capture->warnings, testing::ElementsAre(HasSubstr("no cameras.txt and no focal length in EXIF"),
                                                      HasSubstr("no cameras.txt")));
}

// A JPEG that a camera with a lens of 18 mm (as of 35 mm film) took: EXIF before the image's own segments.
TEST_F(CaptureWithoutPoses, FocalLengthOfExifIsThatOfTheLongerSide) {
  fs::remove(root_ + "/cameras.txt");
  for (const auto& [name, size] :
       {std::pair("h.jpg", cv::Size(60, 120)), std::pair("w.jpg", cv::Size(120, 60))}) {
    std::vector<uint8_t> jpeg;
    ASSERT_TRUE(cv::imencode(".jpg", cv::Mat(size, CV_8U, cv::Scalar(128)), jpeg));
    const std::string exif = ExifJpegOfFocalLength(18);
    Write(std::string("images/") + name,
          exif.substr(0, exif.size() - 2) + std::string(jpeg.begin() + 2, jpeg.end()));
  }
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  for (const CaptureImage& image : capture->images) {
    if (!image.name.ends_with(".jpg")) continue;
    const Camera& camera = capture->cameras.at(image.camera_id);
    EXPECT_EQ(camera.params[0], 18 / 36.0 * 120) << image.name;
    EXPECT_TRUE(camera.has_focal_prior);
  }
  EXPECT_THAT(capture->notes,
              testing::ElementsAre(HasSubstr("f = 60.0 px of 2 images from 35 mm equivalents")));
}

TEST_F(CaptureWithoutPoses, FocalLengthsOfLensAndSensorAreSaidAndWithoutASensorAsked) {
  fs::remove(root_ + "/cameras.txt");
  std::vector<uint8_t> jpeg;
  ASSERT_TRUE(cv::imencode(".jpg", cv::Mat(100, 75, CV_8U, cv::Scalar(128)), jpeg));
  const auto write = [&](const std::string& name, const LensBlock& lens) {
    const std::string exif = ExifJpegOfLens(lens);
    Write("images/" + name, exif.substr(0, exif.size() - 2) + std::string(jpeg.begin() + 2, jpeg.end()));
  };
  write("near.jpg", {});
  write("far.jpg", {.focal_mm = {144, 10}});
  write("unknown.jpg", {.per_unit = {0, 1}});
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  for (const CaptureImage& image : capture->images) {
    if (!image.name.ends_with(".jpg")) continue;
    const Camera& camera = capture->cameras.at(image.camera_id);
    const double focal_px = image.name == "near.jpg" ? 72 : image.name == "far.jpg" ? 144 : 120;
    EXPECT_NEAR(camera.params[0], focal_px, 1e-9) << image.name;
    EXPECT_EQ(camera.has_focal_prior, image.name != "unknown.jpg");
  }
  EXPECT_THAT(
      capture->notes,
      testing::ElementsAre(HasSubstr("f = 72.0 to 144.0 px of 2 images from the lens and the sensor's")));
  EXPECT_THAT(capture->warnings, testing::Contains(HasSubstr(
                                     "no cameras.txt and a focal length in EXIF of 7.2 mm, but nothing that "
                                     "says how large the sensor is: f = 1.2 max(w, h) = 120 px")));
}

// What a list of one image per line cannot hold is rejected where it stands, and nothing after it.
TEST_F(CaptureWithoutPoses, ImagesThatCannotBeUsedAreRejectedAlone) {
  Write("cameras.txt", "1 PINHOLE 3 2 9 8 1.5 1\n2 PINHOLE 2 3 9 8 1 1.5\n");
  Write("images/a\n1 1 0 0 0 0 0 0 1 b.pgm", kWide);
  Write("images/b.pgm", "no image");
  Write("images/c.pgm", kWide);
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  std::vector<std::string> names;
  for (const CaptureImage& image : capture->images) names.push_back(image.name);
  EXPECT_THAT(names, testing::ElementsAre("a.pgm", "c.pgm", "deep/B.PGM"));
  ASSERT_EQ(capture->rejects.size(), 2u);
  EXPECT_THAT(capture->rejects[0].reason, HasSubstr("control character"));
  EXPECT_EQ(capture->rejects[1].name, "b.pgm");
}

TEST_F(CaptureTest, NamesWithControlCharactersAreRejectedFromListsAndNotWritten) {
  AddFiles({"a.jpg"});
  Write("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 1 b\x1b[31m.jpg\n\n");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_EQ(capture->images.size(), 1u);
  ASSERT_EQ(capture->rejects.size(), 1u);
  EXPECT_THAT(capture->rejects[0].reason,
              HasSubstr("images.txt:3: the image's name has a control character"));
  const Status written = WriteImagesText(root_ + "/out.txt", {{"a\n.jpg", 1, Pose()}});
  EXPECT_EQ(written.error().code, ErrorCode::kInvalidArgument);
  EXPECT_FALSE(fs::exists(root_ + "/out.txt"));
}

TEST_F(CaptureTest, NamesThatLeadOutOfTheFolderOfImagesAreRejected) {
  AddFiles({"a.jpg", "deep/b.jpg"});
  Write("beside.jpg", kWide);
  Write("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 1 ../beside.jpg\n\n3 1 0 0 0 0 0 0 1 " +
                          root_ + "/images/a.jpg\n\n4 1 0 0 0 0 0 0 1 deep/b.jpg\n\n");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_EQ(capture->images.size(), 2u);
  ASSERT_EQ(capture->rejects.size(), 2u);
  for (const Reject& reject : capture->rejects)
    EXPECT_THAT(reject.reason, HasSubstr("the image's name leads out of the folder of images"));
}

TEST_F(CaptureWithoutPoses, ListsThatOnlyPosesGiveAMeaningAreNotReadSilently) {
  Write("cameras.txt", "1 PINHOLE 3 2 9 8 1.5 1\n");
  Write("frame.json", "{}");
  Write("beside.pgm", kWide);
  auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_THAT(capture->warnings, testing::ElementsAre(HasSubstr("frame.json: not read"),
                                                      HasSubstr("1 images beside the folder images/")));
  Write("queries.txt", "1 1 0 0 0 0 0 0 1 a.pgm\n\n");
  capture = ReadCapture(root_);
  EXPECT_EQ(capture.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(capture.error().message, HasSubstr("held-out images are given with their poses"));
}

// Odometry under another name was ignored without a word.
TEST_F(CaptureWithoutPoses, WhatLooksLikeOdometryAndIsNotReadIsSaid) {
  Write("cameras.txt", "7 PINHOLE 3 2 9 8 1.5 1\n4 PINHOLE 2 3 6 7 1 1.5\n");
  for (const char* name : {"odometry.csv", "odometry.tum", "odom.csv", "odom.txt"}) {
    Write(name, "1,2,3,4,0,0,0,1\n");
    EXPECT_THAT(
        ReadCapture(root_)->warnings,
        testing::ElementsAre(AllOf(HasSubstr(name), HasSubstr("not read"), HasSubstr("odometry.txt"))));
    fs::remove(root_ + "/" + name);
  }
  Write("odom.csv", "");
  Write("odometry.txt", "");
  EXPECT_THAT(ReadCapture(root_)->warnings, testing::IsEmpty());
}

TEST_F(CaptureWithoutPoses, ALostImageListIsNoMissingOne) {
  fs::create_symlink("nowhere", root_ + "/images.txt");
  EXPECT_THAT(ReadCapture(root_).error().message,
              HasSubstr("images.txt: a link to a file that does not exist"));
}

TEST_F(CaptureWithoutPoses, SessionsMayHaveCamerasOfTheirOwn) {
  Write("sessions.txt", "day0\nday1\nday2\nday3\n");  // the first without cameras, as the last
  fs::remove_all(root_ + "/images");
  for (const char* name : {"day1/1.pgm", "day1/2.pgm", "day2/1.pgm", "day3/1.pgm"})
    Write(std::string("images/") + name, kWide);
  fs::remove(root_ + "/cameras.txt");
  Write("cameras/day1.txt", "5 PINHOLE 3 2 9 8 1.5 1\n");
  Write("cameras/day2.txt", "5 PINHOLE 3 2 7 8 1.5 1\n");
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  ASSERT_EQ(capture->images.size(), 4u);
  EXPECT_EQ(capture->images[0].camera_id, capture->images[1].camera_id);
  ASSERT_EQ(capture->cameras.size(), 3u);
  EXPECT_EQ(capture->cameras.at(capture->images[0].camera_id).params[0], 9);
  EXPECT_EQ(capture->cameras.at(capture->images[2].camera_id).params[0], 7);
  EXPECT_FALSE(capture->cameras.at(capture->images[3].camera_id).has_focal_prior);
}

TEST_F(CaptureTest, AnImageListWithoutCamerasIsAnError) {
  AddFiles({"a.jpg"});
  Write("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n");
  fs::remove(root_ + "/cameras.txt");
  const auto capture = ReadCapture(root_);
  EXPECT_EQ(capture.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(capture.error().message,
              HasSubstr("cameras.txt: no such file, but images.txt names its cameras"));
}

TEST_F(CaptureTest, ImpossibleFoldersAreErrors) {
  EXPECT_EQ(ReadCapture(root_ + "/nowhere").error().code, ErrorCode::kNotFound);
  Write("images.txt", "# nothing\n");
  EXPECT_EQ(ReadCapture(root_).error().code, ErrorCode::kNoData);
}

TEST_F(CaptureTest, WrittenListsReadBackToTheSamePoses) {
  AddFiles({"a.jpg"});
  Pose pose;
  pose.rotation = Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5);
  pose.translation = {1.25, -2.5, 0.125};
  ASSERT_TRUE(WriteImagesText(root_ + "/images.txt", {{"a.jpg", 1, pose}}).ok());
  const auto capture = ReadCapture(root_);
  EXPECT_LT(RotationErrorDeg(*capture->images[0].cam_from_world, pose), 1e-6);
  EXPECT_LT(CenterErrorM(*capture->images[0].cam_from_world, pose), 1e-5);
}

TEST(ParseCamera, AcceptsTheCommandLineForm) {
  const auto camera = ParseCamera("SIMPLE_RADIAL,640,480,500,320,240,-0.1");
  ASSERT_TRUE(camera.ok());
  EXPECT_EQ(camera->model, CameraModel::kSimpleRadial);
  EXPECT_FALSE(ParseCamera("SIMPLE_RADIAL,640,480,500").ok());
  EXPECT_FALSE(ParseCamera("").ok());
}

}  // namespace
}  // namespace cairn
