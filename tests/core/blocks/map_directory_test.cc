#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_blocks.h"
#include "tests/core/blocks/page_bytes.h"

namespace cairn {
namespace {

using testing::HasSubstr;

constexpr int64_t kManyBytes = int64_t{1} << 40;

struct Part {
  BlockKind kind;
  uint32_t first = 0, count = 1, num_bytes = 1000;
  bool is_packed = false;
};

MapDirectory Of(const std::vector<Part>& parts) {
  MapDirectory directory;
  for (const Part& part : parts) {
    directory.Add({.kind = static_cast<uint8_t>(part.kind),
                   .is_packed = part.is_packed,
                   .first = part.first,
                   .count = part.count,
                   .num_bytes = part.num_bytes,
                   .centers = Eigen::AlignedBox3f(Eigen::Vector3f(1, 2, 3), Eigen::Vector3f(4, 5, 6))});
  }
  return directory;
}

std::string DirectoryRefusal(const std::vector<Part>& parts, int64_t max_num_bytes = kManyBytes) {
  return RefusalOf(MapDirectory::Decode(Of(parts).Encode(), max_num_bytes));
}

// One block of each kind that needs another, so that any may be taken along.
std::vector<Part> Everything() {
  return {{BlockKind::kStations},      {BlockKind::kRegions},     {BlockKind::kVocabularyTree},
          {BlockKind::kDocumentNorms}, {BlockKind::kWords},       {BlockKind::kImages},
          {BlockKind::kLandmarks},     {BlockKind::kAppearance},  {BlockKind::kAmbiguity},
          {BlockKind::kFloorPlan},     {BlockKind::kViewRegions}, {BlockKind::kLandmarkModels}};
}

TEST(MapDirectoryLimits, EntriesThatAreCutOffAreRefused) {
  const std::string bytes = Of({{BlockKind::kImages}, {BlockKind::kLandmarks}}).Encode();
  ASSERT_EQ(bytes.size(), 2 * 69u);
  EXPECT_EQ(RefusalOf(MapDirectory::Decode(bytes, kManyBytes)), "");
  for (const size_t size : {size_t{1}, size_t{68}, size_t{70}, bytes.size() - 1})
    EXPECT_THAT(RefusalOf(MapDirectory::Decode(bytes.substr(0, size), kManyBytes)),
                HasSubstr("its entry is cut off"))
        << size;
  EXPECT_THAT(RefusalOf(MapDirectory::Decode(bytes + '\0', kManyBytes)),
              HasSubstr("block 2 (kind 0): its entry is cut off"));
}

// By hand: kind 6, elements 32 to 34, 1000 bytes; the hash; the box, least corner first.
TEST(MapDirectoryLimits, AnEntryIsDrawnInSixtyNineBytes) {
  MapDirectory directory =
      Of({{BlockKind::kImages, 0, 32}, {BlockKind::kImages, 32, 3}, {BlockKind::kLandmarks, 0, 5}});
  const std::string no_hash(32, '\0');
  const std::string box = F32(1) + F32(2) + F32(3) + F32(4) + F32(5) + F32(6);
  const std::string no_box(24, '\0');
  EXPECT_EQ(directory.Encode(), U8(6) + U32(0) + U32(32) + U32(1000) + no_hash + box +      //
                                    U8(6) + U32(32) + U32(3) + U32(1000) + no_hash + box +  //
                                    U8(7) + U32(0) + U32(5) + U32(1000) + no_hash + no_box);
  const Result<MapDirectory> read = MapDirectory::Decode(directory.Encode(), 3000);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->blocks()[1].centers.min(), Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(read->blocks()[1].centers.max(), Eigen::Vector3f(4, 5, 6));
  EXPECT_EQ(read->Count(BlockKind::kImages), 35);
  EXPECT_EQ(read->NumBlocks(BlockKind::kImages), 2);
  EXPECT_EQ(RefusalOf(MapDirectory::Decode(directory.Encode(), 2999)),
            "directory: block 2 (kind 7): more bytes than the file has");
  EXPECT_THAT(RefusalOf(MapDirectory::Decode(directory.Encode().substr(0, 3 * 69 - 1), 3000)),
              HasSubstr("block 2 (kind 7): its entry is cut off"));
}

TEST(MapDirectoryLimits, KindsInFilesSayHowBlocksAreStored) {
  EXPECT_EQ(Of({{BlockKind::kLandmarks, 0, 1, 1000, true}}).Encode()[0], 13);
  EXPECT_EQ(Of({{BlockKind::kImages, 0, 1, 1000, true}}).Encode()[0], 14);
  EXPECT_EQ(Of({{BlockKind::kFloorPlan}}).Encode()[0], 15);
  EXPECT_EQ(Of({{BlockKind::kFloorPlan}, {BlockKind::kViewRegions}}).Encode()[0], 10);
  const std::vector<Part> parts = {{BlockKind::kImages, 0, 1, 1000, true},
                                   {BlockKind::kLandmarks, 0, 1, 1000, true},
                                   {BlockKind::kFloorPlan}};
  const Result<MapDirectory> read = MapDirectory::Decode(Of(parts).Encode(), kManyBytes);
  ASSERT_TRUE(read.ok()) << read.error().message;
  for (size_t i = 0; i < parts.size(); ++i) {
    EXPECT_EQ(read->blocks()[i].kind, static_cast<uint8_t>(parts[i].kind));
    EXPECT_EQ(read->blocks()[i].is_packed, parts[i].is_packed);
  }
  // A kind of a later version is no element of any; its name is none.
  EXPECT_STREQ(BlockKindName(static_cast<BlockKind>(16)), "other");
  EXPECT_STREQ(BlockKindName(BlockKind::kLandmarkModels), "landmark_models");
}

TEST(MapDirectoryLimits, ElementsTakeTheirFewestBytes) {
  const std::pair<BlockKind, uint32_t> fewest[] = {
      {BlockKind::kStations, 5},      {BlockKind::kRegions, 1},      {BlockKind::kVocabularyTree, 1},
      {BlockKind::kDocumentNorms, 4}, {BlockKind::kWords, 1},        {BlockKind::kImages, 29},
      {BlockKind::kLandmarks, 16},    {BlockKind::kAppearance, 4},   {BlockKind::kAmbiguity, 2},
      {BlockKind::kFloorPlan, 33},    {BlockKind::kViewRegions, 26}, {BlockKind::kLandmarkModels, 1}};
  for (const auto& [kind, num_bytes] : fewest) {
    std::vector<Part> parts = Everything();
    for (Part& part : parts) {
      // As many norms as images, as many models as landmarks.
      part.count = 10;
      part.num_bytes = 1000;
      if (part.kind == kind) part.num_bytes = 10 * num_bytes;
    }
    EXPECT_EQ(DirectoryRefusal(parts), "") << BlockKindName(kind);
    for (Part& part : parts) part.num_bytes -= part.kind == kind ? 1 : 0;
    EXPECT_THAT(DirectoryRefusal(parts), HasSubstr("more elements than its bytes can hold, or none"))
        << BlockKindName(kind);
  }
}

TEST(MapDirectoryLimits, PackedLandmarksAreAtMost1024ABlock) {
  EXPECT_EQ(DirectoryRefusal({{BlockKind::kLandmarks, 0, 1024, 1, true}}), "");
  EXPECT_THAT(DirectoryRefusal({{BlockKind::kLandmarks, 0, 1025, 100'000, true}}),
              HasSubstr("more elements"));
  EXPECT_THAT(DirectoryRefusal({{BlockKind::kLandmarks, 0, 0, 100'000, true}}), HasSubstr("more elements"));
  EXPECT_EQ(DirectoryRefusal({{BlockKind::kLandmarks, 0, 1025, 100'000, false}}), "");
  EXPECT_EQ(DirectoryRefusal({{BlockKind::kImages, 0, 1025, 100'000, true}}), "");
  EXPECT_THAT(DirectoryRefusal({{BlockKind::kImages, 0, 1025, 1025 * 29 - 1, true}}),
              HasSubstr("more elements"));
}

TEST(MapDirectoryLimits, BlocksOfAKindFollowOneAnother) {
  EXPECT_EQ(
      DirectoryRefusal({{BlockKind::kStations, 0, 3}, {BlockKind::kImages}, {BlockKind::kStations, 3, 2}}),
      "");
  for (const uint32_t first : {2, 4}) {
    EXPECT_THAT(DirectoryRefusal({{BlockKind::kStations, 0, 3}, {BlockKind::kStations, first, 2}}),
                HasSubstr("block 1 (kind 1): its elements do not follow those of the block before"));
  }
  // Up to 2^31 - 1 of them.
  const uint32_t most = 2147483647;
  std::vector<Part> parts = {{BlockKind::kImages},
                             {BlockKind::kVocabularyTree},
                             {BlockKind::kDocumentNorms},
                             {BlockKind::kWords, 0, most, most}};
  EXPECT_EQ(DirectoryRefusal(parts), "");
  parts.back() = {BlockKind::kWords, 0, most - 1, most};
  parts.push_back({BlockKind::kWords, most - 1, 1});
  EXPECT_EQ(DirectoryRefusal(parts), "");
  parts.back().count = 2;
  EXPECT_THAT(DirectoryRefusal(parts), HasSubstr("block 4 (kind 5): its elements do not follow"));
}

TEST(MapDirectoryLimits, WhatBelongsTogetherIsThere) {
  EXPECT_EQ(DirectoryRefusal(Everything()), "");
  EXPECT_EQ(DirectoryRefusal({}), "");
  const auto without = [](BlockKind kind) {
    std::vector<Part> parts = Everything();
    std::erase_if(parts, [&](const Part& part) { return part.kind == kind; });
    return DirectoryRefusal(parts);
  };
  for (const BlockKind kind :
       {BlockKind::kVocabularyTree, BlockKind::kDocumentNorms, BlockKind::kWords, BlockKind::kImages})
    EXPECT_THAT(without(kind), HasSubstr("a vocabulary tree, words and a norm per image belong together"));
  EXPECT_THAT(without(BlockKind::kFloorPlan), HasSubstr("a floor plan and its regions belong together"));
  EXPECT_EQ(without(BlockKind::kViewRegions), "");  // the plan is then of the kind of those without
  EXPECT_EQ(without(BlockKind::kLandmarkModels), "");
  EXPECT_EQ(without(BlockKind::kLandmarks), "directory: models of 1 landmarks of 0");
  EXPECT_EQ(without(BlockKind::kStations), "directory: 1 regions of 0 stations");
  // A plan that needs its regions.
  std::string with = Of({{BlockKind::kFloorPlan}}).Encode();
  with[0] = 10;
  EXPECT_THAT(RefusalOf(MapDirectory::Decode(with, kManyBytes)), HasSubstr("a floor plan and its regions"));
  // A plan of a kind without regions, and regions.
  with = Of({{BlockKind::kFloorPlan}, {BlockKind::kViewRegions}}).Encode();
  with[0] = 15;
  EXPECT_THAT(RefusalOf(MapDirectory::Decode(with, kManyBytes)), HasSubstr("a floor plan and its regions"));
}

TEST(MapDirectoryLimits, RegionsAreAtMost1024PerStation) {
  EXPECT_EQ(DirectoryRefusal({{BlockKind::kStations, 0, 2}, {BlockKind::kRegions, 0, 2048, 9999}}), "");
  EXPECT_EQ(DirectoryRefusal({{BlockKind::kStations, 0, 2}, {BlockKind::kRegions, 0, 2049, 9999}}),
            "directory: 2049 regions of 2 stations");
}

TEST(MapDirectoryLimits, SomeKindsHaveASingleBlock) {
  for (const BlockKind kind :
       {BlockKind::kVocabularyTree, BlockKind::kDocumentNorms, BlockKind::kFloorPlan}) {
    std::vector<Part> parts = Everything();
    parts.push_back({kind, 1});
    EXPECT_THAT(DirectoryRefusal(parts), HasSubstr("block 12")) << BlockKindName(kind);
    EXPECT_THAT(DirectoryRefusal(parts), HasSubstr("only one block of its kind is allowed"));
  }
}

TEST(MapDirectoryLimits, BoxesOfImagesAreFinite) {
  for (const bool is_least : {true, false}) {
    for (const BlockKind kind : {BlockKind::kImages, BlockKind::kStations}) {
      std::string bytes = Of({{kind}}).Encode();
      bytes.replace(is_least ? 45 + 4 : 57 + 8, 4, F32(std::numeric_limits<float>::infinity()));
      const std::string refusal = RefusalOf(MapDirectory::Decode(bytes, kManyBytes));
      if (kind == BlockKind::kImages) {
        EXPECT_THAT(refusal, HasSubstr("its box of camera centres is not finite"));
      } else {
        EXPECT_EQ(refusal, "");
      }
    }
  }
}

TEST(MapDirectoryLimits, ElementsAreFoundInTheirBlock) {
  const MapDirectory directory = Of({{BlockKind::kLandmarks, 0, 3},
                                     {BlockKind::kImages, 0, 5},
                                     {BlockKind::kLandmarks, 3, 1},
                                     {BlockKind::kLandmarks, 4, 6}});
  const int64_t expected[] = {0, 0, 0, 1, 2, 2};
  for (int64_t i = 0; i < 6; ++i) EXPECT_EQ(directory.OrdinalOf(BlockKind::kLandmarks, i), expected[i]) << i;
  EXPECT_EQ(directory.OrdinalOf(BlockKind::kImages, 4), 0);
  EXPECT_EQ(directory.Block(BlockKind::kLandmarks, 2), 3);
}

}  // namespace
}  // namespace cairn
