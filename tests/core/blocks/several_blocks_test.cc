// What blocks share: models of one survey, and descriptors of any number of bits.
#include <algorithm>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_blocks.h"
#include "core/world/visual_map.h"
#include "tests/core/blocks/page_bytes.h"

namespace cairn {
namespace {

using testing::HasSubstr;

VisualBlock ModelsOfTwoLandmarks() {
  VisualBlock block;
  block.part.camera_id = 3;
  block.part.focal_px = 321.5F;
  block.part.errors = {0.01F, 0.02F, 1.5F, 0.06F};
  block.part.headings_deg = {0, 90};
  block.part.landmarks = {{{.heading = 0}}, {{.heading = 0}, {.heading = 1}}};
  return block;
}

TEST(VisualBlocks, FollowOneAnotherWhereTheirSurveyIsTheSame) {
  VisualMapData all;
  ASSERT_TRUE(AppendModels(ModelsOfTwoLandmarks(), "block 1", &all).ok());
  EXPECT_EQ(all.camera_id, 3u);
  EXPECT_EQ(all.focal_px, 321.5F);
  EXPECT_EQ(all.headings_deg, (std::vector<double>{0, 90}));
  ASSERT_TRUE(AppendModels(ModelsOfTwoLandmarks(), "block 2", &all).ok());
  ASSERT_EQ(all.landmarks.size(), 4u);
  EXPECT_EQ(all.landmarks[2].size(), 1u);
  EXPECT_EQ(all.landmarks[3].size(), 2u);
  for (const auto& change : std::vector<std::function<void(VisualMapData*)>>{
           [](VisualMapData* part) { part->camera_id = 4; },
           [](VisualMapData* part) { part->focal_px = 321.75F; },
           [](VisualMapData* part) { part->errors.tilt_rad = 0.07F; },
           [](VisualMapData* part) { part->headings_deg[1] = 91; },
           [](VisualMapData* part) { part->headings_deg.push_back(180); }}) {
    VisualBlock other = ModelsOfTwoLandmarks();
    change(&other.part);
    const Status status = AppendModels(other, "block 3", &all);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(status.error().message, HasSubstr("block 3: its camera and headings are not those of"));
    EXPECT_EQ(all.landmarks.size(), 4u);
  }
}

// From 2 levels, of a bit, to 256, of eight; so many values that the last byte has any number of bits.
TEST(LandmarkBlocks, DescriptorsOfAnyNumberOfLevelsComeBack) {
  for (const int num_levels : {1, 2, 3, 4, 5, 16, 17, 64, 65, 128, 129, 256}) {
    for (int num_values = 256; num_values <= 264; ++num_values) {
      LandmarkBlock block;
      block.landmarks.resize(1);
      block.descriptors = DescriptorMatrix::Zero(1, num_values);
      for (int i = 0; i < num_values; ++i)
        block.descriptors(0, i) =
            static_cast<uint8_t>((7 * i + 3) % num_levels * 255 / std::max(num_levels - 1, 1));
      MapDirectory directory = DirectoryOf({{BlockKind::kLandmarks, 1}});
      directory.set_descriptor_kind({.type = DescriptorType::kFloat, .num_values = num_values});
      const Result<LandmarkBlock> read =
          DecodeLandmarkBlock(EncodeBlock(block), EntryOf(BlockKind::kLandmarks, 0, 1), directory, "block");
      ASSERT_TRUE(read.ok()) << read.error().message;
      EXPECT_EQ(read->descriptors, block.descriptors) << num_levels << " levels of " << num_values;
    }
  }
}

}  // namespace
}  // namespace cairn
