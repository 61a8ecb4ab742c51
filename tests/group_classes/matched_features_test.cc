#include "stages/group_classes/tracks/matched_features.h"

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::group_classes {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kNumImages = 5, kNumKeypoints = 6;

// A survey of five images, and its database.
class MatchReaderTest : public testing::Test {
 protected:
  MatchReaderTest() {
    Random random(1);
    for (int i = 0; i < kNumImages; ++i) {
      survey_.images.push_back({static_cast<ImageId>(i + 1), fmt::format("{}.png", i), 1});
      Features features;
      features.descriptors.resize(kNumKeypoints, kSiftDescriptorDim);
      for (int k = 0; k < kNumKeypoints; ++k) {
        features.keypoints.push_back({static_cast<float>(k), static_cast<float>(i), 1, 0});
        for (int d = 0; d < kSiftDescriptorDim; ++d)
          features.descriptors(k, d) = static_cast<uint8_t>(random.UniformInt(0, 255));
      }
      survey_.features.push_back(std::move(features));
      for (int j = 0; j < i; ++j) {
        TwoViewGeometry& geometry = survey_.geometries.emplace_back();
        geometry.image_id1 = static_cast<ImageId>(j + 1);
        geometry.image_id2 = static_cast<ImageId>(i + 1);
        geometry.config = TwoViewConfig::kCalibrated;
        for (KeypointIdx k = 0; k < static_cast<KeypointIdx>(j + 1); ++k)
          geometry.inliers.push_back({k, k + 1});
      }
    }
    Camera& camera = survey_.cameras[1];
    camera.camera_id = 1;
    camera.model = CameraModel::kPinhole;
    camera.width = 640;
    camera.height = 480;
    camera.params = {500, 500, 320, 240};
  }
  ~MatchReaderTest() override { std::remove(path_.c_str()); }

  Result<MatchedFeatures> WriteAndRead() {
    std::remove(path_.c_str());
    {
      SQLite::Database database(path_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
      database.exec(kColmapSchema);
      WriteDatabaseCamera(database, survey_.cameras.at(1));
      for (int i = 0; i < kNumImages; ++i) {
        WriteDatabaseImage(database, survey_.images[i]);
        WriteDatabaseFeatures(database, survey_.images[i].image_id, survey_.features[i]);
      }
      for (const TwoViewGeometry& geometry : survey_.geometries)
        WriteDatabaseTwoViewGeometry(database, geometry);
    }
    return ReadMatchedFeatures(path_);
  }

  void Execute(const std::string& sql) { SQLite::Database(path_, SQLite::OPEN_READWRITE).exec(sql); }

  MatchedFeatures survey_;
  const std::string path_ = testing::TempDir() + "match_reader_test.db";
};

std::vector<std::pair<ImageId, ImageId>> PairsOf(MatchReader* reader, size_t* num_matches) {
  std::vector<std::pair<ImageId, ImageId>> pairs;
  *num_matches = 0;
  EXPECT_TRUE(reader
                  ->ForEachPair([&](const TwoViewGeometry& geometry) -> Status {
                    pairs.emplace_back(geometry.image_id1, geometry.image_id2);
                    *num_matches += geometry.inliers.size();
                    return Ok();
                  })
                  .ok());
  return pairs;
}

TEST_F(MatchReaderTest, ReadsFromTheFileWhatWouldBeInMemory) {
  Result<MatchedFeatures> matched = WriteAndRead();
  ASSERT_TRUE(matched.ok()) << matched.error().message;
  EXPECT_TRUE(matched->geometries.empty());
  EXPECT_EQ(matched->features[2].descriptors.rows(), 0);
  EXPECT_EQ(matched->features[2].keypoints.size(), 6u);
  // Descriptors of two images are kept, of one, of none, of all.
  for (const size_t max_num_bytes : {size_t{2} * 6 * 128, size_t{6} * 128, size_t{0}, size_t{1} << 20}) {
    MatchReader reader(*matched, max_num_bytes);
    std::vector<std::shared_ptr<const DescriptorMatrix>> read;
    for (const int image : {0, 1, 0, 2, 3, 0, 4, 4, 1}) {
      const auto descriptors = reader.DescriptorsOf(image);
      ASSERT_TRUE(descriptors.ok());
      EXPECT_TRUE(**descriptors == survey_.features[image].descriptors) << image;
      read.push_back(*descriptors);
    }
    // What is not kept any more is there as long as it is used; what is kept is not read again.
    EXPECT_TRUE(*read[1] == survey_.features[1].descriptors);
    EXPECT_EQ(read[2] == read[0], max_num_bytes >= 2 * 6 * 128);
    EXPECT_EQ(read[5] == read[0], max_num_bytes == size_t{1} << 20);  // the first was not the last used
    EXPECT_EQ(read[7], read[6]);
    size_t num_matches = 0, num_in_memory = 0;
    MatchReader in_memory(survey_);
    const auto pairs = PairsOf(&reader, &num_matches);
    EXPECT_THAT(pairs, testing::UnorderedElementsAreArray(PairsOf(&in_memory, &num_in_memory)));
    EXPECT_TRUE(std::is_sorted(pairs.begin(), pairs.end()));
    EXPECT_EQ(num_matches, num_in_memory);
    EXPECT_TRUE(**in_memory.DescriptorsOf(3) == survey_.features[3].descriptors);
  }
}

TEST_F(MatchReaderTest, KeepsWhatWasUsedLast) {
  const Result<MatchedFeatures> matched = WriteAndRead();
  ASSERT_TRUE(matched.ok());
  MatchReader reader(*matched, size_t{2} * 6 * 128);
  std::vector<std::shared_ptr<const DescriptorMatrix>> read;
  for (const int image : {0, 1, 0, 2, 0, 1}) read.push_back(*reader.DescriptorsOf(image));
  EXPECT_EQ(read[2], read[0]);
  EXPECT_EQ(read[4], read[0]);  // 1 had not been used for longer
  EXPECT_NE(read[5], read[1]);
  EXPECT_TRUE(*read[5] == survey_.features[1].descriptors);
}

TEST_F(MatchReaderTest, AFileThatTakesItsPlaceIsAnother) {
  const Result<MatchedFeatures> matched = WriteAndRead();
  ASSERT_TRUE(matched.ok());
  const DescriptorMatrix before = survey_.features[0].descriptors;
  survey_.features[0].descriptors.row(0).setZero();
  ASSERT_TRUE(WriteAndRead().ok());
  EXPECT_TRUE(**MatchReader(*matched).DescriptorsOf(0) == before);
}

TEST_F(MatchReaderTest, EndsAtAnErrorOfTheVisitor) {
  const Result<MatchedFeatures> matched = WriteAndRead();
  ASSERT_TRUE(matched.ok());
  for (const MatchedFeatures* of : std::initializer_list<const MatchedFeatures*>{&*matched, &survey_}) {
    MatchReader reader(*of);
    int num_visited = 0;
    const Status status = reader.ForEachPair([&](const TwoViewGeometry&) -> Status {
      if (++num_visited == 3) return Error{ErrorCode::kCancelled, "enough"};
      return Ok();
    });
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().message, "enough");
    EXPECT_EQ(num_visited, 3);
  }
}

TEST_F(MatchReaderTest, WhatIsNotThereIsCorrupt) {
  const auto error_of = [&](const std::string& sql) {
    EXPECT_TRUE(WriteAndRead().ok());
    Execute(sql);
    const Result<MatchedFeatures> matched = ReadMatchedFeatures(path_);
    EXPECT_TRUE(matched.ok());
    MatchReader reader(*matched);
    Status status = reader.ForEachPair([](const TwoViewGeometry&) { return Ok(); });
    for (int image = 0; image < kNumImages && status.ok(); ++image) {
      if (const auto descriptors = reader.DescriptorsOf(image); !descriptors.ok())
        status = descriptors.error();
    }
    EXPECT_FALSE(status.ok()) << sql;
    if (status.ok()) return std::string();
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt) << status.error().message;
    EXPECT_THAT(status.error().message, HasSubstr(path_));
    return status.error().message;
  };
  EXPECT_THAT(error_of("DELETE FROM descriptors WHERE image_id = 4"), HasSubstr("3.png"));
  EXPECT_THAT(error_of("UPDATE descriptors SET rows = 5, data = substr(data, 1, 640) WHERE image_id = 2"),
              HasSubstr("image 1.png has 6 keypoints but 5 descriptors"));
  EXPECT_THAT(
      error_of("UPDATE two_view_geometries SET data = x'0900000009000000', rows = 1 WHERE pair_id = (SELECT "
               "min(pair_id) FROM two_view_geometries)"),
      HasSubstr("9"));
  EXPECT_THAT(error_of("DELETE FROM images WHERE image_id = 5; DELETE FROM keypoints WHERE image_id = 5"),
              HasSubstr("5"));
}

}  // namespace
}  // namespace cairn::group_classes
