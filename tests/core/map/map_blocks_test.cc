#include "core/blocks/map_blocks.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/blob.h"
#include "core/base/random.h"
#include "core/blocks/map_layout.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"

namespace cairn {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::Pair;
using testing::SizeIs;

MapRows RowsOfAllBlocks() {
  const EmitExample example = MakeEmitExample();
  MapRows rows =
      *emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                         {.landmarks = "regions", .min_num_landmarks_for_words = 0, .landmarks_per_word = 1},
                         &example.appearance);
  rows.views = MakeExampleViews();
  rows.visual_map = MakeExampleVisualMap();
  return rows;
}

// Landmarks in regions of these sizes, one after the other, and some in none.
MapRows RowsWithRegions(const std::vector<int>& sizes, int num_others) {
  MapRows rows;
  Camera camera;
  camera.width = camera.height = 100;
  camera.params = {100, 50, 50};
  rows.cameras = {camera};
  LandmarkIdx next = 0;
  for (const int size : sizes) {
    MapRegion& region = rows.regions.emplace_back();
    for (int i = 0; i < size; ++i) region.landmarks.push_back(next++);
  }
  rows.landmarks.resize(next + num_others);
  rows.descriptors = DescriptorMatrix::Zero(next + num_others, kSiftDescriptorDim);
  return rows;
}

std::vector<std::pair<int, int>> LandmarkBlocks(const MapRows& rows) {
  std::vector<std::pair<int, int>> blocks;
  const MapLayout layout(rows);
  for (const BlockEntry& entry : layout.entries()) {
    if (entry.kind == static_cast<uint8_t>(BlockKind::kLandmarks))
      blocks.emplace_back(entry.first, entry.count);
  }
  return blocks;
}

TEST(MapLayout, SmallRegionsShareABlockAndNoneIsSplit) {
  EXPECT_THAT(LandmarkBlocks(RowsWithRegions({500, 500, 100}, 0)),
              ElementsAre(Pair(0, 1000), Pair(1000, 100)));
  EXPECT_THAT(LandmarkBlocks(RowsWithRegions({40, 1000}, 20)), ElementsAre(Pair(0, 40), Pair(40, 1020)));
}

TEST(MapLayout, LargeRegionsAreRunsOfBlocks) {
  EXPECT_THAT(LandmarkBlocks(RowsWithRegions({10, 2500}, 0)),
              ElementsAre(Pair(0, 10), Pair(10, 1024), Pair(1034, 1024), Pair(2058, 452)));
}

// Words with so many postings each, cut into blocks: numbers of words of each.
std::vector<uint32_t> WordsOfBlocks(size_t num_words, size_t num_postings) {
  MapRows rows;
  rows.vocabulary.nodes.resize(1);
  rows.vocabulary.inverted_files.assign(num_words, std::vector<Posting>(num_postings));
  const MapLayout layout(rows);
  std::vector<uint32_t> words_of_blocks;
  for (const BlockEntry& entry : layout.entries()) {
    if (entry.kind == static_cast<uint8_t>(BlockKind::kWords)) words_of_blocks.push_back(entry.count);
  }
  return words_of_blocks;
}

TEST(MapLayout, BlocksOfManyPostingsAreSmall) {
  EXPECT_THAT(WordsOfBlocks(9, 1000), ElementsAre(5, 4));  // 4096 postings
  EXPECT_THAT(WordsOfBlocks(4, size_t{1} << 10), ElementsAre(4));
  EXPECT_THAT(WordsOfBlocks(3000, 1), ElementsAre(1024, 1024, 952));
  // 1024 postings, of more than 2^22 in all.
  const std::vector<uint32_t> at_limit = WordsOfBlocks(1 << 12, size_t{1} << 10);
  EXPECT_THAT(at_limit, Each(4));
  const std::vector<uint32_t> beyond = WordsOfBlocks((1 << 13) + 2, size_t{1} << 9);
  EXPECT_THAT(beyond, Each(2));
  EXPECT_THAT(beyond, SizeIs((1 << 12) + 1));
}

TEST(MapLayout, BlocksKnowTheirRegionsAndImages) {
  const MapRows rows = RowsOfAllBlocks();
  const MapLayout layout(rows);
  for (const BlockEntry& entry : layout.entries()) {
    if (entry.kind == static_cast<uint8_t>(BlockKind::kLandmarks)) {
      const LandmarkBlock block = layout.MakeLandmarkBlock(entry);
      EXPECT_THAT(block.regions, ElementsAre(Pair(0, ElementsAre(0, 1)), Pair(1, ElementsAre(0, 2))));
      EXPECT_THAT(block.image_blocks, ElementsAre(0));
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kImages)) {
      for (const MapImage& image : rows.images) {
        EXPECT_TRUE(entry.centers.contains(image.cam_from_world.Center().cast<float>()));
      }
    }
  }
}

// Every block of the example as bytes, with the directory that goes with them.
struct EncodedBlocks {
  MapRows rows = RowsOfAllBlocks();
  MapDirectory directory;
  std::vector<std::string> bytes;

  EncodedBlocks() {
    const MapLayout layout(rows);
    for (BlockEntry entry : layout.entries()) {
      bytes.push_back(layout.Encode(entry));
      entry.num_bytes = static_cast<uint32_t>(bytes.back().size());
      directory.Add(entry);
    }
  }
  Status Decode(size_t block, const std::string& changed) const {
    const BlockEntry& entry = directory.blocks()[block];
    switch (static_cast<BlockKind>(entry.kind)) {
      case BlockKind::kStations:
        CAIRN_RETURN_IF_ERROR(DecodeStationBlock(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kRegions:
        CAIRN_RETURN_IF_ERROR(DecodeRegionBlock(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kVocabularyTree:
        CAIRN_RETURN_IF_ERROR(DecodeVocabularyTree(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kDocumentNorms:
        CAIRN_RETURN_IF_ERROR(DecodeDocumentNorms(changed, entry, "block"));
        return Ok();
      case BlockKind::kWords:
        CAIRN_RETURN_IF_ERROR(DecodeWordBlock(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kImages:
        CAIRN_RETURN_IF_ERROR(DecodeImageBlock(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kLandmarks:
        CAIRN_RETURN_IF_ERROR(DecodeLandmarkBlock(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kAppearance:
        CAIRN_RETURN_IF_ERROR(DecodeAppearanceBlock(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kAmbiguity:
        CAIRN_RETURN_IF_ERROR(DecodeAmbiguityBlock(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kFloorPlan:
        CAIRN_RETURN_IF_ERROR(DecodeFloorPlan(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kViewRegions:
        CAIRN_RETURN_IF_ERROR(DecodeViewBlock(changed, entry, directory, "block"));
        return Ok();
      case BlockKind::kLandmarkModels:
        CAIRN_RETURN_IF_ERROR(DecodeVisualBlock(changed, entry, directory, "block"));
        return Ok();
    }
    return Ok();
  }
};

TEST(MapBlocks, EveryTruncationIsRefused) {
  const EncodedBlocks blocks;
  ASSERT_EQ(blocks.bytes.size(), 12u);
  for (size_t block = 0; block < blocks.bytes.size(); ++block) {
    const std::string& bytes = blocks.bytes[block];
    EXPECT_TRUE(blocks.Decode(block, bytes).ok());
    for (size_t size = 0; size < bytes.size(); ++size) {
      const Status status = blocks.Decode(block, bytes.substr(0, size));
      ASSERT_FALSE(status.ok()) << block << ": " << size;
      EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
    }
    EXPECT_FALSE(blocks.Decode(block, bytes + '\0').ok()) << block;
  }
}

TEST(MapBlocks, AnyBytesAreRefusedOrDecoded) {
  const EncodedBlocks blocks;
  Random random(1);
  for (int i = 0; i < 20000; ++i) {
    const size_t block = random.UniformInt(0, blocks.bytes.size() - 1);
    std::string bytes = blocks.bytes[block];
    for (uint64_t change = random.UniformInt(1, 4); change > 0; --change) {
      bytes[random.UniformInt(0, bytes.size() - 1)] = static_cast<char>(random.UniformInt(0, 255));
    }
    const Status status = blocks.Decode(block, bytes);
    EXPECT_TRUE(status.ok() || status.error().code == ErrorCode::kCorrupt);
  }
}

TEST(MapBlocks, ReferencesToWhatIsNotThereAreRefused) {
  EncodedBlocks blocks;
  const MapLayout layout(blocks.rows);
  for (size_t i = 0; i < blocks.directory.blocks().size(); ++i) {
    const BlockEntry& entry = blocks.directory.blocks()[i];
    if (entry.kind == static_cast<uint8_t>(BlockKind::kImages)) {
      ImageBlock images = layout.MakeImageBlock(entry);
      images.images[1].landmarks = {0, 3};
      EXPECT_FALSE(blocks.Decode(i, EncodeBlock(images)).ok());
      images = layout.MakeImageBlock(entry);
      images.images[1].station = 3;
      EXPECT_FALSE(blocks.Decode(i, EncodeBlock(images)).ok());
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kAppearance)) {
      for (const auto& change : std::vector<std::function<void(MapAppearanceNode&)>>{
               [](MapAppearanceNode& node) { node.images = {3}; },
               [](MapAppearanceNode& node) { node.images.clear(); },
               [](MapAppearanceNode& node) {
                 node.links = {{3, 1}};
               },
               [](MapAppearanceNode& node) {
                 node.links = {{0, 1}};
               },
               [](MapAppearanceNode& node) {
                 node.links = {{1, 0}};
               }}) {
        AppearanceBlock nodes = layout.MakeAppearanceBlock(entry);
        change(nodes.nodes[0]);
        EXPECT_FALSE(blocks.Decode(i, EncodeBlock(nodes)).ok());
      }
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kAmbiguity)) {
      for (const auto& change : std::vector<std::function<void(AmbiguityBlock::Node&)>>{
               [](AmbiguityBlock::Node& node) { node.entropy = 65; },
               [](AmbiguityBlock::Node& node) {
                 node.look_alikes = {{3, 0.5}};
               },
               [](AmbiguityBlock::Node& node) {
                 node.look_alikes = {{0, 0.5}};
               },
               [](AmbiguityBlock::Node& node) {
                 node.look_alikes = {{1, 0}};
               },
               [](AmbiguityBlock::Node& node) {
                 node.look_alikes = {{1, 1.001}};
               }}) {
        AmbiguityBlock nodes = layout.MakeAmbiguityBlock(entry);
        change(nodes.nodes[0]);
        EXPECT_FALSE(blocks.Decode(i, EncodeBlock(nodes)).ok());
      }
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kFloorPlan)) {
      FloorPlan plan = blocks.rows.views.plan;
      plan.pieces[2].end = 4;
      EXPECT_FALSE(blocks.Decode(i, EncodeFloorPlan(plan)).ok());
      plan = blocks.rows.views.plan;
      plan.walls[1].start.x() = std::nan("");
      EXPECT_FALSE(blocks.Decode(i, EncodeFloorPlan(plan)).ok());
      plan = blocks.rows.views.plan;
      plan.vertices[2].x = 2 * kMaxGridCoordinate;
      EXPECT_FALSE(blocks.Decode(i, EncodeFloorPlan(plan)).ok());
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kViewRegions)) {
      for (const auto& change : std::vector<std::function<void(ViewBlock::Region&)>>{
               [](ViewBlock::Region& region) { region.toggled = {8}; },
               [](ViewBlock::Region& region) {
                 region.corners = {0, 1};
               },
               [](ViewBlock::Region& region) { region.index.num_labels = 9; },
               [](ViewBlock::Region& region) { region.links[0].b = 2; },
               [](ViewBlock::Region& region) { region.links[0].b = 0; }}) {
        ViewBlock regions = layout.MakeViewBlock(entry);
        change(regions.regions[0]);
        EXPECT_FALSE(blocks.Decode(i, EncodeBlock(regions)).ok());
      }
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kLandmarkModels)) {
      for (const auto& change : std::vector<std::function<void(VisualMapData&)>>{
               [](VisualMapData& part) { part.landmarks[0][0].heading = 3; },
               [](VisualMapData& part) { part.landmarks[0][0].shape.length = kNumKernelLengths; },
               [](VisualMapData& part) { part.landmarks[0][0].sights[2].image = 3; },
               [](VisualMapData& part) { part.landmarks[0][0].sights.pop_back(); },
               [](VisualMapData& part) { part.headings_deg[2] = 360; },
               [](VisualMapData& part) { part.headings_deg[2] = 90; },
               [](VisualMapData& part) { part.headings_deg.clear(); },
               [](VisualMapData& part) { part.focal_px = -1; },
               [](VisualMapData& part) { part.errors.growth_per_m = -1; },
               [](VisualMapData& part) { part.errors.shared_m = std::nanf(""); },
               [](VisualMapData& part) { part.focal_px = std::nanf(""); }}) {
        VisualBlock models = layout.MakeVisualBlock(entry);
        change(models.part);
        EXPECT_FALSE(blocks.Decode(i, EncodeBlock(models)).ok());
      }
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kWords)) {
      const WordBlock words = layout.MakeWordBlock(entry);
      std::vector<std::vector<Posting>> postings;
      for (size_t word = 0; word < words.num_words(); ++word) {
        postings.push_back(words.Postings(word));
        EXPECT_EQ(words.NumPostings(word), postings.back().size());
      }
      EXPECT_EQ(PackWords(words.first, postings).bytes, words.bytes);
      // What is read without checks was checked.
      const auto decode = [&](const std::string& first_word) {
        return DecodeWordBlock(first_word + std::string(entry.count - 1, '\0'), entry, blocks.directory,
                               "block");
      };
      const auto varint = [](uint64_t value) {
        BlobWriter writer;
        writer.Varint(value);
        return writer.Take();
      };
      const uint64_t most = std::numeric_limits<int32_t>::max();
      EXPECT_EQ(decode("\x01" + std::string("\x80\x00", 2))->Postings(0).at(0).document,
                0);  // longer than needed
      EXPECT_EQ(decode("\x01\x01" + varint(most - 2))->Postings(0).at(0).count,
                std::numeric_limits<int32_t>::max());
      EXPECT_FALSE(decode("\x01\x01" + varint(most - 1)).ok());
      EXPECT_FALSE(decode("\x01" + std::string(9, '\x80') + "\x01").ok());
      EXPECT_FALSE(decode("\x02" + std::string(1, '\0')).ok());
      EXPECT_FALSE(decode(std::string(2, '\0')).ok());
      postings[0].back().document = 3;
      EXPECT_FALSE(blocks.Decode(i, EncodeBlock(PackWords(words.first, postings))).ok());
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kStations)) {
      StationBlock stations = layout.MakeStationBlock(entry);
      stations.neighbours[2] = {1};
      EXPECT_FALSE(blocks.Decode(i, EncodeBlock(stations)).ok());
      stations = layout.MakeStationBlock(entry);
      stations.regions[0] = {2};
      EXPECT_FALSE(blocks.Decode(i, EncodeBlock(stations)).ok());
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kRegions)) {
      RegionBlock regions = layout.MakeRegionBlock(entry);
      regions.landmark_blocks[0] = {1};
      EXPECT_FALSE(blocks.Decode(i, EncodeBlock(regions)).ok());
    } else if (entry.kind == static_cast<uint8_t>(BlockKind::kLandmarks)) {
      LandmarkBlock landmarks = layout.MakeLandmarkBlock(entry);
      landmarks.regions[1].first = 2;
      EXPECT_FALSE(blocks.Decode(i, EncodeBlock(landmarks)).ok());
      landmarks = layout.MakeLandmarkBlock(entry);
      landmarks.image_blocks = {1};
      EXPECT_FALSE(blocks.Decode(i, EncodeBlock(landmarks)).ok());
    }
  }
}

TEST(MapDirectory, DecodesWhatItEncoded) {
  const EncodedBlocks blocks;
  const std::string bytes = blocks.directory.Encode();
  EXPECT_EQ(bytes.size(), 69 * blocks.bytes.size());
  const Result<MapDirectory> decoded = MapDirectory::Decode(bytes, 1'000'000);
  ASSERT_TRUE(decoded.ok()) << decoded.error().message;
  EXPECT_EQ(decoded->Encode(), bytes);
  EXPECT_EQ(decoded->Count(BlockKind::kLandmarks), 3);
  EXPECT_EQ(decoded->OrdinalOf(BlockKind::kLandmarks, 2), 0);
}

TEST(MapDirectory, EntriesThatMakeNoSenseAreRefused) {
  const EncodedBlocks blocks;
  EXPECT_FALSE(MapDirectory::Decode(blocks.directory.Encode(), 100).ok());  // more bytes than the file
  EXPECT_FALSE(MapDirectory::Decode(blocks.directory.Encode().substr(0, 100), 1'000'000).ok());
  const auto with = [&](const std::function<void(BlockEntry*)>& change) {
    MapDirectory changed;
    for (BlockEntry entry : blocks.directory.blocks()) {
      if (entry.kind == static_cast<uint8_t>(BlockKind::kLandmarks)) change(&entry);
      changed.Add(entry);
    }
    return MapDirectory::Decode(changed.Encode(), 1'000'000).ok();
  };
  EXPECT_TRUE(with([](BlockEntry*) {}));
  MapDirectory later;
  for (const BlockEntry& entry : blocks.directory.blocks()) later.Add(entry);
  BlockEntry unknown = blocks.directory.blocks().back();
  unknown.first = 0;
  unknown.kind = 200;  // of a later minor version
  later.Add(unknown);
  EXPECT_TRUE(MapDirectory::Decode(later.Encode(), 1'000'000).ok());
  EXPECT_FALSE(with([](BlockEntry* entry) { entry->first = 1; }));
  EXPECT_FALSE(with([](BlockEntry* entry) { entry->count = 1000; }));
  EXPECT_FALSE(with([](BlockEntry* entry) { entry->count = 0; }));
}

}  // namespace
}  // namespace cairn
