#include "core/capture/capture_features.h"

#include <cmath>
#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/capture.h"
#include "core/capture/join_captures.h"
#include "core/files/file.h"
#include "tests/core/capture/features_database.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<std::string> Names(const Capture& capture) {
  std::vector<std::string> names;
  for (const CaptureImage& image : capture.images) names.push_back(image.name);
  return names;
}

class CaptureFeaturesTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = testing::TempDir() + "/capture_features_" +
            testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void Write(const std::string& name, const std::string& text) {
    fs::create_directories(fs::path(root_ + "/" + name).parent_path());
    ASSERT_TRUE(WriteFileAtomically(root_ + "/" + name, text).ok());
  }
  void WriteFeatures(const std::string& name, const std::vector<std::string>& images) {
    fs::create_directories(fs::path(root_ + "/" + name).parent_path());
    std::vector<std::pair<std::string, Features>> rows;
    for (const std::string& image : images) rows.emplace_back(image, RandomFeatures(rows.size(), 5));
    ASSERT_TRUE(WriteFeaturesDatabase(root_ + "/" + name, FeaturesCamera(3), rows).ok());
  }
  void WriteLists(const std::string& folder, const std::vector<std::string>& images) {
    Write(folder + "cameras.txt", "1 PINHOLE 640 480 525 525 320 240\n");
    std::string lines;
    for (const std::string& image : images) lines += "1 1 0 0 0 0 0 0 1 " + image + "\n\n";
    Write(folder + "images.txt", lines);
  }

  // What is said of the features of one image, whose first keypoint is this one.
  std::string Refusal(const Keypoint& keypoint) {
    Features features = RandomFeatures(1, 3);
    features.keypoints[0] = keypoint;
    const std::string path = root_ + "/bad.db";
    EXPECT_TRUE(WriteFeaturesDatabase(path, FeaturesCamera(1), {{"a.jpg", features}}).ok());
    const auto read = ReadCaptureFeatures({path, 1, FeaturesCamera(1)}, FeaturesCamera(1));
    return read.ok() ? "" : read.error().message;
  }

  std::string root_;
};

TEST_F(CaptureFeaturesTest, ListedImagesWithoutAFileHaveThoseOfTheDatabase) {
  Write("images/a.jpg", "x");
  WriteLists("", {"a.jpg", "b.jpg", "deep/c.jpg", "none.jpg"});
  WriteFeatures("features.db", {"deep/c.jpg", "a.jpg", "b.jpg", "unlisted.jpg"});
  const auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_THAT(Names(*capture), ElementsAre("a.jpg", "b.jpg", "deep/c.jpg"));
  EXPECT_EQ(capture->FeaturesOf(capture->images[0]), nullptr);  // its file counts
  ASSERT_NE(capture->FeaturesOf(capture->images[1]), nullptr);
  EXPECT_EQ(capture->FeaturesOf(capture->images[1])->image_id, 3u);
  EXPECT_EQ(capture->FeaturesOf(capture->images[2])->image_id, 1u);
  ASSERT_EQ(capture->rejects.size(), 1u);
  EXPECT_EQ(capture->rejects[0].name, "none.jpg");
  EXPECT_THAT(capture->rejects[0].reason,
              HasSubstr("none.jpg: no such file, and no such image in " + root_ + "/features.db"));
  EXPECT_TRUE(capture->has_poses);
}

TEST_F(CaptureFeaturesTest, WithoutAListTheyAreTheImagesWhereThereIsNoFile) {
  WriteFeatures("features.db", {"b.jpg", "a.jpg"});
  auto capture = ReadCapture(root_);
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_THAT(Names(*capture), ElementsAre("a.jpg", "b.jpg"));
  EXPECT_FALSE(capture->has_poses);
  ASSERT_EQ(capture->cameras.size(), 1u);
  EXPECT_THAT(capture->cameras.begin()->second.params, ElementsAre(500, 500, 320, 240));
  Write("cameras.txt", "7 PINHOLE 640 480 510 510 320 240\n");
  capture = ReadCapture(root_);
  EXPECT_EQ(capture->images[0].camera_id, 7u);
  Write("cameras.txt", "7 PINHOLE 320 240 510 510 320 240\n");
  EXPECT_THAT(ReadCapture(root_).error().message,
              HasSubstr("has 640 x 480 pixels, as no camera of " + root_));
  // What a stage has left beside images is not read.
  fs::remove(root_ + "/cameras.txt");
  Write("images/c.pgm", "P5\n3 2\n255\nabcdef");
  Write("features.db", "nothing");
  EXPECT_THAT(Names(*ReadCapture(root_)), ElementsAre("c.pgm"));
}

// Twelve images of 40 kB each, one after the other, cut at any byte.
TEST_F(CaptureFeaturesTest, OfADatabaseCutOffWhatIsWholeIsRead) {
  const std::string path = root_ + "/features.db";
  std::vector<std::pair<std::string, Features>> images;
  std::vector<std::string> names;
  for (int i = 0; i < 12; ++i) {
    names.push_back(fmt::format("{:02}.jpg", i));
    images.emplace_back(names.back(), RandomFeatures(i, 300));
  }
  ASSERT_TRUE(WriteFeaturesDatabase(path, FeaturesCamera(1), images).ok());
  WriteLists("", names);
  const std::string whole = *ReadFile(path);
  size_t num_read_before = 0, num_cut_inside_of_a_page = 0;
  for (size_t num_bytes = 4096; num_bytes < whole.size(); num_bytes += 4567) {
    Write("features.db", whole.substr(0, num_bytes));
    const auto capture = ReadCapture(root_);
    size_t num_read = 0;
    if (!capture.ok()) {
      EXPECT_EQ(capture.error().code, ErrorCode::kCorrupt) << num_bytes;
      EXPECT_THAT(capture.error().message,
                  HasSubstr(fmt::format("{}: truncated: {} of {} bytes", path, num_bytes, whole.size())));
    } else {
      EXPECT_THAT(capture->warnings,
                  ElementsAre(HasSubstr(fmt::format("{} of {} bytes are there", num_bytes, whole.size()))));
      for (size_t i = 0; i < capture->images.size(); ++i) {
        const CaptureImage& image = capture->images[i];
        const auto read = ReadCaptureFeatures(*capture->FeaturesOf(image), capture->cameras.at(1));
        if (!read.ok()) {
          EXPECT_THAT(read.error().message, HasSubstr("the features of image " + std::to_string(i + 1)));
          continue;
        }
        // All of it, but for the end of the last descriptor, which may have been on the last page.
        const Features& truth = images[std::stoi(image.name)].second;
        ASSERT_EQ(read->descriptors.rows(), 300) << num_bytes;
        EXPECT_EQ(read->descriptors.topRows(299), truth.descriptors.topRows(299)) << num_bytes;
        EXPECT_EQ(read->keypoints.back().x, truth.keypoints.back().x);
        num_cut_inside_of_a_page += read->descriptors != truth.descriptors;
        ++num_read;
      }
    }
    EXPECT_GE(num_read, num_read_before) << num_bytes;
    // The first rows of a table are on a page that is written when the second one begins.
    if (2 * num_bytes > whole.size()) {
      EXPECT_GE(num_read + 3, 12 * num_bytes / whole.size()) << num_bytes;
    }
    num_read_before = num_read;
  }
  EXPECT_GE(num_read_before, 10u);
  EXPECT_LE(num_cut_inside_of_a_page, 1u);
}

TEST_F(CaptureFeaturesTest, BrokenDatabaseIsAnErrorThatNamesIt) {
  WriteLists("", {"a.jpg", "b.jpg"});
  Write("features.db", "no database");
  auto capture = ReadCapture(root_);
  ASSERT_FALSE(capture.ok());
  EXPECT_EQ(capture.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(capture.error().message, HasSubstr(root_ + "/features.db"));
  WriteFeatures("features.db", {"a.jpg", "b.jpg"});
  fs::resize_file(root_ + "/features.db", 4096);
  capture = ReadCapture(root_);
  ASSERT_FALSE(capture.ok());
  EXPECT_THAT(capture.error().message, HasSubstr(root_ + "/features.db"));
  fs::remove(root_ + "/features.db");
  EXPECT_EQ(ReadCapture(root_).error().code, ErrorCode::kNoData);
}

TEST_F(CaptureFeaturesTest, FeaturesThatFitNoImageAreRefusedWithWhatIsWrong) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(Refusal({10, 20, 2, 0}), "");
  EXPECT_EQ(Refusal({640, 480, 2, 0}), "");
  EXPECT_THAT(Refusal({700, 20, 2, 0}), HasSubstr("keypoint 0 at (700, 20) is not in 640 x 480 px"));
  EXPECT_THAT(Refusal({10, -20, 2, 0}), HasSubstr("is not in 640 x 480 px"));
  EXPECT_THAT(Refusal({nan, 20, 2, 0}), HasSubstr("keypoint 0 is not finite"));
  EXPECT_THAT(Refusal({10, 20, 0, 0}), HasSubstr("keypoint 0 has the scale 0"));
  const std::string path = root_ + "/features.db";
  ASSERT_TRUE(WriteFeaturesDatabase(path, FeaturesCamera(1), {{"a.jpg", RandomFeatures(1, 4)}}).ok());
  SQLite::Database(path, SQLite::OPEN_READWRITE)
      .exec("UPDATE descriptors SET rows = 3, data = substr(data, 1, 3 * 128)");
  EXPECT_THAT(ReadCaptureFeatures({path, 1, FeaturesCamera(1)}, FeaturesCamera(1)).error().message,
              HasSubstr("4 keypoints and 3 descriptors"));
  Camera larger = FeaturesCamera(1);
  larger.width = 800;
  EXPECT_THAT(ReadCaptureFeatures({path, 1, FeaturesCamera(1)}, larger).error().message,
              HasSubstr("an image of 640 x 480 px, but its camera 1 has 800 x 480 px"));
}

TEST_F(CaptureFeaturesTest, LandmarksOfAMapAreKnownAsSuch) {
  const std::string path = root_ + "/features.db";
  ASSERT_TRUE(WriteFeaturesDatabase(
                  path, FeaturesCamera(1), {{"a.jpg", RandomFeatures(1, 4)}, {"b.jpg", RandomFeatures(2, 4)}},
                  std::string(kLandmarkFeaturesSchema) + "INSERT INTO cairn_landmark_images VALUES (2);")
                  .ok());
  CaptureFeatures features(root_);
  EXPECT_FALSE((*features.Find("a.jpg"))->are_landmarks);
  EXPECT_TRUE((*features.Find("b.jpg"))->are_landmarks);
  EXPECT_EQ(*features.Find("c.jpg"), nullptr);
}

TEST_F(CaptureFeaturesTest, JoinedCapturesHaveThemUnderTheirSession) {
  WriteLists("day1/", {"1.jpg", "2.jpg"});
  WriteFeatures("day1/features.db", {"1.jpg", "2.jpg"});
  WriteFeatures("day2/features.db", {"1.jpg", "9.jpg"});
  Write("day3/images/1.pgm", "P5\n3 2\n255\nabcdef");
  const auto joined = JoinCaptures({{.name = "day1", .root = root_ + "/day1"},
                                    {.name = "day2", .root = root_ + "/day2"},
                                    {.name = "day3", .root = root_ + "/day3"}},
                                   root_ + "/joined");
  ASSERT_TRUE(joined.ok()) << joined.error().message;
  const auto capture = ReadCapture(root_ + "/joined");
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_THAT(Names(*capture),
              ElementsAre("day1/1.jpg", "day1/2.jpg", "day2/1.jpg", "day2/9.jpg", "day3/1.pgm"));
  EXPECT_THAT(capture->registered, ElementsAre("day2", "day3"));
  EXPECT_THAT(capture->rejects, IsEmpty());
  ASSERT_EQ(capture->features.size(), 4u);
  EXPECT_EQ(capture->features.at("day2/9.jpg").image_id, 2u);
  EXPECT_EQ(capture->features.at("day2/9.jpg").path, root_ + "/joined/features/day2.db");
  EXPECT_EQ(ReadCaptureFeatures(capture->features.at("day1/1.jpg"), FeaturesCamera(1))->keypoints.size(), 5u);
}

}  // namespace
}  // namespace cairn
