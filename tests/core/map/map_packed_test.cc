// Maps whose landmarks and sights are packed (format 2.6).
#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "core/base/random.h"
#include "core/blocks/map_layout.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "core/packing/packed_sights.h"
#include "tests/core/map/packed_rows.h"
#include "tests/core/map/sealed_blocks.h"

namespace cairn {
namespace {

using testing::HasSubstr;

std::string Written(const MapRows& rows) {
  const std::string path = testing::TempDir() + "/packed.cairn";
  const Status status = WriteMapRows(rows, path);
  EXPECT_TRUE(status.ok()) << status.error().message;
  return path;
}

TEST(PackedMap, IsReadAsItWasWrittenUpToStatedErrors) {
  const MapRows rows = PackedRows();
  const Result<MapRows> read = ReadMapRows(Written(rows));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->descriptor_code, rows.descriptor_code);
  EXPECT_EQ(read->descriptors, rows.descriptors);
  for (size_t i = 0; i < rows.images.size(); ++i)
    EXPECT_EQ(read->images[i].landmarks, rows.images[i].landmarks) << i;
  for (size_t i = 0; i < rows.landmarks.size(); ++i) {
    const MapLandmark &a = rows.landmarks[i], &b = read->landmarks[i];
    EXPECT_EQ(a.class_id, b.class_id);
    EXPECT_EQ(a.num_observations, b.num_observations);
    if (a.scale_m > 0) {
      EXPECT_NEAR(b.scale_m / a.scale_m, 1, 0.092);
    }
    // Half a unit, which is at most 0.4 of the least conditional standard deviation, plus the grid of 0.1 mm.
    const Eigen::Matrix3d factor = a.covariance.llt().matrixL();
    EXPECT_LE((a.position - b.position).cwiseAbs().maxCoeff(),
              0.22 * factor.diagonal().minCoeff() + 1.001e-4);
    // Seen in units of the one, the other is near the unit matrix.
    const Eigen::Matrix3d inverse = factor.inverse();
    const Eigen::Vector3d ratios = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(
                                       inverse * b.covariance * inverse.transpose(), Eigen::EigenvaluesOnly)
                                       .eigenvalues();
    EXPECT_GT(ratios.minCoeff(), 0.4);
    EXPECT_LT(ratios.maxCoeff(), 2.4);
  }
  EXPECT_EQ(read->landmarks[3].scale_m, 0);
}

TEST(PackedMap, WhatWasReadIsWrittenAsTheSameBytes) {
  const std::string path = Written(PackedRows());
  const std::string bytes = *ReadFile(path);
  EXPECT_EQ(*ReadFile(Written(*ReadMapRows(path))), bytes);
}

TEST(PackedMap, TakesHalfTheBytesOfOneThatIsNot) {
  MapRows rows = PackedRows();
  const size_t packed = ReadFile(Written(rows))->size();
  rows.descriptor_code.reset();
  EXPECT_LT(packed, ReadFile(Written(rows))->size() / 2);
}

TEST(PackedMap, DescriptorsThatLevelsDoNotStandForAreStoredWhole) {
  MapRows rows = PackedRows();
  rows.descriptors.row(5).setConstant(255);
  rows.descriptors(5, 17) = 0;
  rows.descriptors.row(1200).setZero();
  rows.descriptors(1200, 0) = 255;
  EXPECT_EQ(ReadMapRows(Written(rows))->descriptors, rows.descriptors);
}

TEST(PackedMap, DegenerateCovariancesAndPlacesAreRead) {
  MapRows rows = PackedRows();
  rows.landmarks[0].covariance.setZero();
  rows.landmarks[1].covariance.setConstant(1e-4);  // of rank 1
  rows.landmarks[2].covariance = Eigen::Vector3d(0, 1e6, 1e-20).asDiagonal();
  rows.landmarks[3].position = {2e5, -2e5, 2e5};
  rows.landmarks[3].covariance = Eigen::Vector3d(1e10, 1e10, 1e10).asDiagonal();
  const std::string path = Written(rows);
  const Result<MapRows> read = ReadMapRows(path);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_TRUE(read->landmarks[0].covariance.isZero(0));
  EXPECT_NEAR(read->landmarks[1].covariance(2, 0), 1e-4, 0.25e-4);
  const std::string bytes = *ReadFile(path);
  EXPECT_EQ(*ReadFile(Written(*read)), bytes);
}

// A step of 0, bytes cut off or added, any byte changed: refused, or decoded to something valid.
TEST(PackedMap, DamagedBlocksAreRefusedOrDecoded) {
  const MapRows rows = PackedRows();
  const MapLayout layout(rows);
  MapDirectory directory;
  std::vector<std::string> blocks;
  for (BlockEntry entry : layout.entries()) {
    blocks.push_back(layout.Encode(entry));
    entry.num_bytes = static_cast<uint32_t>(blocks.back().size());
    directory.Add(entry);
  }
  const auto decode = [&](size_t block, const std::string& bytes) -> Status {
    const BlockEntry& entry = directory.blocks()[block];
    EXPECT_TRUE(entry.is_packed);
    if (entry.kind == static_cast<uint8_t>(BlockKind::kImages)) {
      CAIRN_RETURN_IF_ERROR(DecodeImageBlock(bytes, entry, directory, "map.cairn: block"));
    } else {
      CAIRN_RETURN_IF_ERROR(DecodeLandmarkBlock(bytes, entry, directory, "map.cairn: block"));
    }
    return Ok();
  };
  ASSERT_EQ(blocks.size(), 4u);
  Random random(5);
  for (size_t block = 0; block < blocks.size(); ++block) {
    const std::string& bytes = blocks[block];
    EXPECT_TRUE(decode(block, bytes).ok());
    EXPECT_FALSE(decode(block, bytes + '\0').ok());
    for (int i = 0; i < 100; ++i) {
      const size_t size = i < 20 ? bytes.size() - 1 - i : random.UniformInt(0, bytes.size() - 1);
      const Status status = decode(block, bytes.substr(0, size));
      ASSERT_FALSE(status.ok()) << block << ": " << size;
      EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
      EXPECT_THAT(status.error().message, HasSubstr("map.cairn: block"));
    }
    for (int i = 0; i < 200; ++i) {
      std::string changed = bytes;
      changed[random.UniformInt(0, bytes.size() - 1)] = static_cast<char>(random.UniformInt(0, 255));
      const Status status = decode(block, changed);
      EXPECT_TRUE(status.ok() || status.error().code == ErrorCode::kCorrupt);
    }
  }
}

TEST(PackedMap, BlocksOfMoreLandmarksThanAreWrittenAreRefused) {
  MapDirectory directory;
  directory.Add({.kind = static_cast<uint8_t>(BlockKind::kLandmarks),
                 .is_packed = true,
                 .count = 1024,
                 .num_bytes = 150});
  EXPECT_TRUE(MapDirectory::Decode(directory.Encode(), 1000).ok());
  MapDirectory larger;
  larger.Add({.kind = static_cast<uint8_t>(BlockKind::kLandmarks),
              .is_packed = true,
              .count = 1025,
              .num_bytes = 150});
  EXPECT_FALSE(MapDirectory::Decode(larger.Encode(), 1000).ok());
  EXPECT_EQ(static_cast<uint8_t>(directory.Encode()[0]), 13);
  EXPECT_TRUE(MapDirectory::Decode(directory.Encode(), 1000)->blocks()[0].is_packed);
}

// Three images of five landmarks: the images' lists alone, by bits whose models are all even at first.
// The second of two blocks of landmarks is that of a map whose descriptors are of coarser levels.
TEST(PackedMap, BlocksOfLandmarksWithDifferentCodesAreRefused) {
  const std::string path = testing::TempDir() + "/two_codes.cairn";
  std::vector<std::vector<BlockContents>> maps;
  std::string bytes;
  for (const int step : {40, 24}) {
    ASSERT_TRUE(WriteMapRows(PackedRows(step), path).ok());
    const MapFile file = *MapFile::Open(path, {});
    maps.push_back(BlocksOf(file));
    for (size_t i = 0; i < maps.back().size(); ++i)
      maps.back()[i].is_packed = file.directory().blocks()[i].is_packed;
    bytes = *ReadFile(path);
  }
  std::vector<BlockContents>& blocks = maps[1];
  ASSERT_TRUE(WriteSealedBlocks(bytes, blocks, path).ok());
  EXPECT_TRUE(ReadMapRows(path).ok()) << ReadMapRows(path).error().message;
  size_t second = blocks.size();
  while (blocks[--second].kind != BlockKind::kLandmarks) continue;
  ASSERT_EQ(blocks[second - 1].kind, BlockKind::kLandmarks);
  ASSERT_EQ(blocks[second].count, maps[0][second].count);
  blocks[second] = maps[0][second];
  ASSERT_TRUE(WriteSealedBlocks(bytes, blocks, path).ok());
  const Result<MapRows> read = ReadMapRows(path);
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(read.error().message,
              testing::HasSubstr("its blocks of landmarks are coded in different ways"));
}

TEST(PackedSights, ListsOfAnyKindAreRead) {
  SightLists images(5);
  images[0] = {0, 1, 4};
  images[1] = {0, 1, 4};
  images[3] = {2, 5000, 5001, 99'999};
  images[4] = {99'999};
  const std::string bytes = PackSights(images);
  SightLists read(5);
  int64_t num_left = 1000;
  ASSERT_TRUE(UnpackSights(bytes, 100'000, 10, &num_left, &read));
  for (size_t i = 0; i < images.size(); ++i) EXPECT_EQ(read[i], images[i]) << i;
  EXPECT_FALSE(UnpackSights(bytes, 99'999, 10, &num_left, &read));  // names a landmark that the map lacks
  EXPECT_FALSE(UnpackSights(bytes, 100'000, 3, &num_left, &read));  // more than an image may see
}

}  // namespace
}  // namespace cairn
