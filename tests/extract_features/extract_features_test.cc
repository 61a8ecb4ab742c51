#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "tests/core/capture/features_database.h"
#include "tests/extract_features/capture_fixture.h"

namespace cairn::extract_features {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

TEST_F(ExtractFeaturesTest, SameBytesForAnyNumberOfThreads) {
  for (int i = 0; i < 5; ++i) AddImage("image" + std::to_string(i) + ".png", BlobImage(i));
  ASSERT_TRUE(Extract(1).ok());
  const std::string one = *ReadFile(root_ + "/features.db");
  ASSERT_TRUE(Extract(3).ok());
  EXPECT_EQ(HashBytes(one), *HashFile(root_ + "/features.db"));
}

TEST_F(ExtractFeaturesTest, FeaturesComeBackFromTheDatabase) {
  AddImage("b.png", BlobImage(1));
  AddImage("a.png", BlobImage(2));
  const auto summary = Extract();
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  auto database = OpenDatabaseReadOnly(root_ + "/features.db");
  ASSERT_TRUE(database.ok());
  const auto images = ReadDatabaseImages(*database);
  ASSERT_EQ(images->size(), 2u);
  EXPECT_EQ((*images)[0].name, "a.png");  // ids in the order of names
  const auto keypoints = ReadDatabaseKeypoints(*database, 1);
  const auto descriptors = ReadDatabaseDescriptors(*database, 1);
  ASSERT_GT(keypoints->size(), 50u);
  EXPECT_EQ(static_cast<Eigen::Index>(keypoints->size()), descriptors->rows());
  for (int i = 0; i < descriptors->rows(); ++i) {
    EXPECT_NEAR(descriptors->row(i).cast<double>().norm(), 512, 8);  // RootSIFT has unit norm
  }
}

TEST_F(ExtractFeaturesTest, BadImagesAreRejectedWithReasonsAndTheRestGoesOn) {
  AddImage("good.png", BlobImage(1));
  AddImage("small.png", BlobImage(2, 100, 80));
  AddImage("whole.jpg", BlobImage(3));
  const std::string jpeg = *ReadFile(root_ + "/images/whole.jpg");
  std::ofstream(root_ + "/images/cut.jpg", std::ios::binary) << jpeg.substr(0, jpeg.size() / 2);
  List("cut.jpg");
  std::ofstream(root_ + "/images/empty.png");
  List("empty.png");
  std::ofstream(root_ + "/images/text.png") << "not an image";
  List("text.png");
  List("missing.png");
  std::ofstream(root_ + "/images/stray.png") << "x";
  const auto summary = Extract();
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->num_images, 2);
  std::map<std::string, std::string> reasons;
  for (const Reject& reject : summary->rejects) reasons[reject.name] = reject.reason;
  EXPECT_EQ(reasons.size(), 5u);
  EXPECT_THAT(reasons["small.png"], HasSubstr("100 x 80 px, but its camera 1 has 320 x 240 px"));
  EXPECT_THAT(reasons["cut.jpg"], HasSubstr("truncated JPEG"));
  EXPECT_THAT(reasons["empty.png"], HasSubstr("zero bytes"));
  EXPECT_THAT(reasons["text.png"], HasSubstr("not an image"));
  EXPECT_THAT(reasons["missing.png"], HasSubstr("no such file"));
  EXPECT_THAT(ReadCapture(root_)->warnings, testing::ElementsAre(HasSubstr("stray.png: in neither")));
}

TEST_F(ExtractFeaturesTest, NoReadableImageIsAnErrorAndLeavesNoFile) {
  std::ofstream(root_ + "/images/empty.png");
  List("empty.png");
  const auto summary = Extract();
  ASSERT_FALSE(summary.ok());
  EXPECT_EQ(summary.error().code, ErrorCode::kNoData);
  EXPECT_FALSE(fs::exists(root_ + "/features.db"));
}

TEST_F(ExtractFeaturesTest, MaskSwitchesPixelsOff) {
  AddImage("a.png", BlobImage(1));
  fs::create_directories(root_ + "/masks");
  cv::Mat mask(240, 320, CV_8UC1, cv::Scalar(255));
  mask(cv::Rect(0, 0, 160, 240)) = 0;
  cv::imwrite(root_ + "/masks/a.png", mask);
  ExtractFeaturesOptions options;
  options.masks = "masks";
  ASSERT_TRUE(Extract(1, options).ok());
  auto database = OpenDatabaseReadOnly(root_ + "/features.db");
  const auto keypoints = ReadDatabaseKeypoints(*database, 1);
  ASSERT_GT(keypoints->size(), 10u);
  for (const Keypoint& keypoint : *keypoints) EXPECT_GE(keypoint.x, 159);
}

TEST_F(ExtractFeaturesTest, FeaturesOfImagesWithoutAFileAreTakenAsTheyAre) {
  AddImage("a.png", BlobImage(1));
  List("b.png");
  List("c.png");
  const Features given = RandomFeatures(1, 30);
  Features outside = RandomFeatures(2, 30);
  outside.keypoints[7].x = 900;
  const Camera camera = FeaturesCamera(4);
  ASSERT_TRUE(WriteCamerasText(root_ + "/cameras.txt", {{1, camera}}).ok());
  cv::imwrite(root_ + "/images/a.png", BlobImage(1, 640, 480));
  ASSERT_TRUE(WriteFeaturesDatabase(
                  root_ + "/features.db", camera, {{"c.png", outside}, {"b.png", given}},
                  std::string(kLandmarkFeaturesSchema) + "INSERT INTO cairn_landmark_images VALUES (2);")
                  .ok());
  ExtractFeaturesOptions options;
  options.sift.max_num_features = 10;
  const auto summary = ExtractTo("out.db", {}, 2, options);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->num_images, 2);
  ASSERT_EQ(summary->rejects.size(), 1u);
  EXPECT_EQ(summary->rejects[0].name, "c.png");
  EXPECT_THAT(summary->rejects[0].reason, HasSubstr("keypoint 7 at (900, "));
  EXPECT_THAT(summary->inputs, testing::Contains(root_ + "/features.db"));
  EXPECT_THAT(summary->inputs, testing::Not(testing::Contains(root_ + "/images/b.png")));
  auto database = OpenDatabaseReadOnly(root_ + "/out.db");
  const auto keypoints = ReadDatabaseKeypoints(*database, 2);
  ASSERT_EQ(keypoints->size(), 30u);  // whatever the options say
  EXPECT_EQ(keypoints->at(29).x, given.keypoints[29].x);
  EXPECT_EQ(*ReadDatabaseDescriptors(*database, 2), given.descriptors);
  EXPECT_EQ(database->execAndGet("SELECT group_concat(image_id) FROM cairn_landmark_images").getString(),
            "2");
}

TEST_F(ExtractFeaturesTest, GivenFeaturesOfAPanoramaAreRejected) {
  List("b.png");
  AddImage("a.png", BlobImage(1));
  Camera camera;
  camera.model = CameraModel::kEquirectangular;
  camera.width = 640;
  camera.height = 480;
  camera.params = {640, 480};
  Camera small = FeaturesCamera(2);
  small.width = 320;
  small.height = 240;
  images_[1].camera_id = 2;
  ASSERT_TRUE(WriteImagesText(root_ + "/images.txt", images_).ok());
  ASSERT_TRUE(WriteCamerasText(root_ + "/cameras.txt", {{1, camera}, {2, small}}).ok());
  ASSERT_TRUE(
      WriteFeaturesDatabase(root_ + "/features.db", FeaturesCamera(1), {{"b.png", RandomFeatures(1, 3)}})
          .ok());
  const auto summary = ExtractTo("out.db", {});
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  ASSERT_EQ(summary->rejects.size(), 1u);
  EXPECT_THAT(summary->rejects[0].reason, HasSubstr("features of a panorama"));
}

TEST_F(ExtractFeaturesTest, BlankImageHasNoFeaturesButIsKept) {
  AddImage("blank.png", cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)));
  AddImage("good.png", BlobImage(1));
  const auto summary = Extract();
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->num_images, 2);
}

TEST_F(ExtractFeaturesTest, FoldersBlanksAndOtherAlphabetsInNamesWork) {
  fs::create_directories(root_ + "/images/a");
  fs::create_directories(root_ + "/images/b");
  const std::vector<std::string> names = {"a/1.png", "b/1.png", "two words.png", "図書館.png"};
  for (size_t i = 0; i < names.size(); ++i) AddImage(names[i], BlobImage(i));
  const auto summary = Extract();
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_TRUE(summary->rejects.empty());
  auto database = OpenDatabaseReadOnly(root_ + "/features.db");
  const auto images = ReadDatabaseImages(*database);
  ASSERT_EQ(images->size(), names.size());
  for (size_t i = 0; i < names.size(); ++i) EXPECT_EQ((*images)[i].name, names[i]);
  EXPECT_NE(ReadDatabaseKeypoints(*database, 1)->front().x, ReadDatabaseKeypoints(*database, 2)->front().x)
      << "two images, not one twice";
}

TEST_F(ExtractFeaturesTest, AnImageOfOnePixelIsKeptWithoutFeatures) {
  Camera tiny;
  tiny.width = tiny.height = 1;
  tiny.params = {1, 0.5, 0.5};
  ASSERT_TRUE(WriteCamerasText(root_ + "/cameras.txt", {{1, tiny}}).ok());
  AddImage("tiny.png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(9)));
  const auto summary = Extract();
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->num_keypoints, 0);
}

// A panorama of blobs: as a capture with one camera EQUIRECTANGULAR.
TEST_F(ExtractFeaturesTest, PanoramasBecomePinholeViewsThatColmapReads) {
  Camera panorama;
  panorama.model = CameraModel::kEquirectangular;
  panorama.width = 640;
  panorama.height = 320;
  ASSERT_TRUE(WriteCamerasText(root_ + "/cameras.txt", {{1, panorama}}).ok());
  AddImage("p.png", BlobImage(1, 640, 320));
  AddImage("q.png", BlobImage(2, 640, 320));
  const auto summary = Extract();
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  EXPECT_EQ(summary->num_images, 2);
  EXPECT_EQ(summary->num_views, 12);
  {
    auto database = OpenDatabaseReadOnly(root_ + "/features.db");
    const auto images = ReadDatabaseImages(*database);
    ASSERT_EQ(images->size(), 12u);
    EXPECT_EQ((*images)[0].name, "p.png#0of6");
    EXPECT_EQ((*images)[11].name, "q.png#5of6");
    const auto cameras = ReadDatabaseCameras(*database);
    ASSERT_EQ(cameras->size(), 1u);
    EXPECT_EQ(cameras->at(1).model, CameraModel::kPinhole);
    EXPECT_NEAR(cameras->at(1).FocalX(), 640 / (2 * M_PI), 1e-9);
    for (const DatabaseImage& image : *images) {
      const auto keypoints = ReadDatabaseKeypoints(*database, image.image_id);
      EXPECT_GT(keypoints->size(), 5u) << image.name;
      for (const Keypoint& keypoint : *keypoints) {
        const double angle =
            std::atan((keypoint.x - cameras->at(1).PrincipalPoint().x()) / cameras->at(1).FocalX());
        EXPECT_LE(std::abs(angle), M_PI / 6 + 1e-6) << "another view's sector";
      }
    }
  }
  const std::string copy = root_ + "/copy.db";
  fs::copy_file(root_ + "/features.db", copy);
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap exhaustive_matcher --SiftMatching.use_gpu 0 --database_path " + copy +
      " > " + root_ + "/colmap.log 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << *ReadFile(root_ + "/colmap.log");

  ExtractFeaturesOptions gaps;
  gaps.panorama.num_panorama_views = 3;
  EXPECT_EQ(Extract(1, gaps).error().code, ErrorCode::kInvalidArgument);
}

// The installed colmap reads what we wrote: the strictest check of the schema there is.
TEST_F(ExtractFeaturesTest, ColmapReadsTheDatabase) {
  for (int i = 0; i < 2; ++i) AddImage("image" + std::to_string(i) + ".png", BlobImage(i));
  ASSERT_TRUE(Extract().ok());
  const std::string copy = root_ + "/copy.db";
  fs::copy_file(root_ + "/features.db", copy);
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap exhaustive_matcher --SiftMatching.use_gpu 0 --database_path " + copy +
      " > " + root_ + "/colmap.log 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << *ReadFile(root_ + "/colmap.log");
}

}  // namespace
}  // namespace cairn::extract_features
