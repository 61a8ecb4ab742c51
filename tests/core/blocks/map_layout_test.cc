#include "core/blocks/map_layout.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_blocks.h"
#include "tests/core/blocks/page_bytes.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

std::vector<std::pair<int, int>> BlocksOfKind(const MapLayout& layout, BlockKind kind) {
  std::vector<std::pair<int, int>> blocks;
  for (const BlockEntry& entry : layout.entries()) {
    if (entry.kind == static_cast<uint8_t>(kind)) blocks.emplace_back(entry.first, entry.count);
  }
  return blocks;
}

// More of everything than one block holds.
TEST(MapLayoutSizes, EveryKindIsCutAtItsOwnSize) {
  MapRows rows;
  rows.stations.resize(1025);
  rows.regions.resize(1026);
  rows.images.resize(65);
  rows.landmarks.resize(258);
  rows.descriptors = DescriptorMatrix::Zero(258, kSiftDescriptorDim);
  rows.appearance.resize(1027);
  rows.visual_map.landmarks.resize(258);
  rows.views.plan.walls.resize(3);
  for (MapRegion& region : rows.regions) region.stations = {0};
  MapLayout layout(rows);
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kStations), ElementsAre(Pair(0, 1024), Pair(1024, 1)));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kRegions), ElementsAre(Pair(0, 1024), Pair(1024, 2)));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kAppearance), ElementsAre(Pair(0, 1024), Pair(1024, 3)));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kAmbiguity), IsEmpty());
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kImages), ElementsAre(Pair(0, 32), Pair(32, 32), Pair(64, 1)));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kLandmarks), ElementsAre(Pair(0, 258)));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kLandmarkModels), ElementsAre(Pair(0, 256), Pair(256, 2)));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kFloorPlan), ElementsAre(Pair(0, 3)));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kVocabularyTree), IsEmpty());
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kDocumentNorms), IsEmpty());
  for (const BlockEntry& entry : layout.entries()) EXPECT_FALSE(entry.is_packed);
  // With a code images and landmarks are packed, and images in blocks twice as large.
  rows.descriptor_code = TransformCode();
  for (MapAppearanceNode& node : rows.appearance) node.entropy = 0;
  const MapLayout packed(rows);
  EXPECT_THAT(BlocksOfKind(packed, BlockKind::kImages), ElementsAre(Pair(0, 64), Pair(64, 1)));
  EXPECT_THAT(BlocksOfKind(packed, BlockKind::kAmbiguity), ElementsAre(Pair(0, 1024), Pair(1024, 3)));
  for (const BlockEntry& entry : packed.entries()) {
    EXPECT_EQ(entry.is_packed, entry.kind == static_cast<uint8_t>(BlockKind::kImages) ||
                                   entry.kind == static_cast<uint8_t>(BlockKind::kLandmarks));
  }
}

// 0.2 mm and 2e-7 of the distance from the origin around the cameras of the block's own images.
TEST(MapLayoutSizes, BoxesHoldTheCamerasOfTheirImages) {
  MapRows rows;
  rows.images.resize(33);
  for (MapImage& image : rows.images)
    image.cam_from_world.translation = {-1, -2, -2};  // centres at 1, 2, 2: 3 m away
  rows.images[5].cam_from_world.translation = {1, -2, -2};
  rows.images[32].cam_from_world.translation = {-3e4, 0, 4e4};  // 5e4 m away
  const MapLayout layout(rows);
  const Eigen::AlignedBox3f& first = layout.entries()[0].centers;
  const float margin = 2e-4F + 6e-7F;
  EXPECT_NEAR(first.min().x(), -1 - margin, 1e-7);
  EXPECT_NEAR(first.min().y(), 2 - margin, 3e-7);
  EXPECT_NEAR(first.max().x(), 1 + margin, 1e-7);
  EXPECT_NEAR(first.max().z(), 2 + margin, 3e-7);
  const Eigen::AlignedBox3f& second = layout.entries()[1].centers;
  EXPECT_NEAR(second.min().x(), 3e4 - 0.0102, 0.002);  // floats are 0.002 apart there
  EXPECT_NEAR(second.max().x(), 3e4 + 0.0102, 0.002);
  EXPECT_NEAR(second.max().y(), 0.0102, 1e-6);
  EXPECT_NEAR(second.max().z(), -4e4 + 0.0102, 0.004);
}

// Stations 1022 to 1025 in a row across two blocks, regions of them, and an edge far ahead.
TEST(MapLayoutSizes, StationsKnowTheirNeighboursAndRegions) {
  MapRows rows;
  rows.stations.resize(1030);
  rows.station_edges = {{0, 1029}, {1022, 1023}, {1022, 1024}, {1023, 1024}, {1024, 1025}, {1028, 1029}};
  rows.regions = {{.stations = {1023, 1024}}, {.stations = {1024, 1029}}};
  const MapLayout layout(rows);
  const StationBlock first = layout.MakeStationBlock(layout.entries()[0]);
  EXPECT_THAT(first.neighbours[0], ElementsAre(1029));
  EXPECT_THAT(first.neighbours[1022], ElementsAre(1023, 1024));
  EXPECT_THAT(first.neighbours[1023], ElementsAre(1024));
  EXPECT_THAT(first.regions[1023], ElementsAre(0));
  EXPECT_THAT(first.regions[1022], IsEmpty());
  const StationBlock second = layout.MakeStationBlock(layout.entries()[1]);
  EXPECT_EQ(second.first, 1024);
  ASSERT_EQ(second.stations.size(), 6u);
  EXPECT_THAT(second.neighbours,
              ElementsAre(ElementsAre(1025), IsEmpty(), IsEmpty(), IsEmpty(), ElementsAre(1029), IsEmpty()));
  EXPECT_THAT(second.regions,
              ElementsAre(ElementsAre(0, 1), IsEmpty(), IsEmpty(), IsEmpty(), IsEmpty(), ElementsAre(1)));
}

// Region 0 has landmarks 0 to 1023, a block; region 1 one of these and those after; images see one of each
// block, or both.
TEST(MapLayoutSizes, BlocksOfLandmarksKnowWhoSeesThem) {
  MapRows rows;
  rows.landmarks.resize(1030);
  for (size_t i = 0; i < rows.landmarks.size(); ++i) rows.landmarks[i].class_id = static_cast<ClassId>(i);
  rows.descriptors = DescriptorMatrix::Zero(1030, kSiftDescriptorDim);
  rows.descriptors(1024, 0) = 7;
  rows.regions.resize(2);
  for (int i = 0; i < 1024; ++i) rows.regions[0].landmarks.push_back(i);
  rows.regions[1].landmarks = {5, 1024, 1025, 1029};
  rows.images.resize(70);
  rows.images[0].landmarks = {0, 1024};
  rows.images[1].landmarks = {3};
  rows.images[40].landmarks = {1023};
  rows.images[69].landmarks = {1029};
  const MapLayout layout(rows);
  std::vector<BlockEntry> entries;
  for (const BlockEntry& entry : layout.entries()) {
    if (entry.kind == static_cast<uint8_t>(BlockKind::kLandmarks)) entries.push_back(entry);
  }
  ASSERT_EQ(entries.size(), 2u);
  const LandmarkBlock first = layout.MakeLandmarkBlock(entries[0]);
  ASSERT_EQ(first.regions.size(), 2u);
  EXPECT_EQ(first.regions[0].second.size(), 1024u);
  EXPECT_THAT(first.regions[1], Pair(1, ElementsAre(5)));
  EXPECT_THAT(first.image_blocks, ElementsAre(0, 1));
  const LandmarkBlock second = layout.MakeLandmarkBlock(entries[1]);
  EXPECT_EQ(second.first, 1024);
  ASSERT_EQ(second.landmarks.size(), 6u);
  EXPECT_EQ(second.landmarks[0].class_id, 1024u);
  EXPECT_EQ(second.descriptors(0, 0), 7);
  EXPECT_EQ(second.descriptors.rows(), 6);
  EXPECT_THAT(second.regions, ElementsAre(Pair(1, ElementsAre(1024, 1025, 1029))));
  EXPECT_THAT(second.image_blocks, ElementsAre(0, 2));
  const RegionBlock regions = layout.MakeRegionBlock(layout.entries()[0]);
  EXPECT_THAT(regions.landmark_blocks, ElementsAre(ElementsAre(0), ElementsAre(0, 1)));
}

// A block may be as large as the limit; a region that would make it larger begins another.
TEST(MapLayoutSizes, RegionsThatFillABlockStayInIt) {
  MapRows rows;
  rows.landmarks.resize(2049);
  rows.descriptors = DescriptorMatrix::Zero(2049, kSiftDescriptorDim);
  rows.regions.resize(3);
  for (int i = 0; i < 2048; ++i) rows.regions[i < 1000 ? 0 : i < 1024 ? 1 : 2].landmarks.push_back(i);
  const MapLayout layout(rows);
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kLandmarks),
              ElementsAre(Pair(0, 1024), Pair(1024, 1024), Pair(2048, 1)));
}

// Documents are images 2 and 4 of five: their norms and postings stand at these.
TEST(MapLayoutSizes, DocumentsAreImages) {
  MapRows rows;
  rows.images.resize(5);
  for (size_t i = 0; i < 5; ++i) rows.images[i].image_id = static_cast<ImageId>(10 * i);
  rows.vocabulary.nodes.resize(1);
  rows.vocabulary.document_ids = {20, 40};
  rows.vocabulary.document_norms = {0.5F, 2};
  rows.vocabulary.inverted_files = {{{0, 3}, {1, 1}}, {}, {{1, 2}}};
  const MapLayout layout(rows);
  EXPECT_THAT(layout.MakeDocumentNorms(), ElementsAre(0, 0, 0.5F, 0, 2));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kDocumentNorms), ElementsAre(Pair(0, 5)));
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kVocabularyTree), ElementsAre(Pair(0, 1)));
  const WordBlock words = layout.MakeWordBlock(EntryOf(BlockKind::kWords, 0, 3));
  EXPECT_EQ(words.Postings(0), (std::vector<Posting>{{2, 3}, {4, 1}}));
  EXPECT_THAT(words.Postings(1), IsEmpty());
  EXPECT_EQ(words.Postings(2), (std::vector<Posting>{{4, 2}}));
}

// A strip of 4100 faces: each shares its first two corners with the one before, and every third has a border
// that ends, or begins, at a vertex which no face has as a corner up to there.
Views Strip(FaceIdx num_faces, bool begins) {
  Views views;
  views.plan.walls.resize(2);
  views.face_offsets = {0};
  views.toggle_offsets = {0};
  int32_t next = 0;
  int32_t a = 0, b = 0;
  for (FaceIdx face = 0; face < num_faces; ++face) {
    if (face == 0) a = next++, b = next++;
    const int32_t c = next++, d = next++;
    for (const int32_t corner : {a, b, c, d}) views.face_vertices.push_back(corner);
    views.face_offsets.push_back(static_cast<int64_t>(views.face_vertices.size()));
    views.parents.push_back(face - 1);
    views.toggled_labels.push_back(face % 4);
    views.toggle_offsets.push_back(static_cast<int64_t>(views.toggled_labels.size()));
    views.index.push_back({.num_labels = face % 4});
    const int32_t other = face % 3 == 0 ? next++ : d;
    if (face + 1 < num_faces) views.links.push_back({face, face + 1, begins ? other : c, begins ? c : other});
    a = c, b = d;
  }
  for (int32_t i = 0; i < next; ++i) views.vertices.push_back({3 * i, -i});
  return views;
}

void ExpectStripComesBack(bool begins) {
  MapRows rows;
  rows.views = Strip(4100, begins);
  const MapLayout layout(rows);
  EXPECT_THAT(BlocksOfKind(layout, BlockKind::kViewRegions), ElementsAre(Pair(0, 4096), Pair(4096, 4)));
  MapDirectory directory;
  for (const BlockEntry& entry : layout.entries()) directory.Add(entry);
  Views read;
  read.face_offsets = {0};
  read.toggle_offsets = {0};
  for (const BlockEntry& entry : layout.entries()) {
    if (entry.kind != static_cast<uint8_t>(BlockKind::kViewRegions)) continue;
    const Result<ViewBlock> block = DecodeViewBlock(layout.Encode(entry), entry, directory, "block");
    ASSERT_TRUE(block.ok()) << block.error().message;
    EXPECT_TRUE(AppendRegions(*block, "block", &read).ok());
    EXPECT_EQ(EncodeBlock(*block), layout.Encode(entry));
    // Of a border's vertices, those that are no corner up to there come before it.
    for (const ViewBlock::Region& region : block->regions) {
      const bool is_named_first = !region.links.empty() && region.links[0].a % 3 == 0;
      ASSERT_EQ(region.num_more_vertices, is_named_first ? 1 : 0);
    }
    // Again, it does not follow.
    EXPECT_THAT(AppendRegions(*block, "block", &read).error().message, testing::HasSubstr("come before it"));
  }
  EXPECT_EQ(read.vertices, rows.views.vertices);
  EXPECT_EQ(read.face_vertices, rows.views.face_vertices);
  EXPECT_EQ(read.face_offsets, rows.views.face_offsets);
  EXPECT_EQ(read.parents, rows.views.parents);
  EXPECT_EQ(read.toggled_labels, rows.views.toggled_labels);
  EXPECT_EQ(read.links, rows.views.links);
}

TEST(MapLayoutSizes, ViewRegionsOfTwoBlocksComeBack) {
  for (const bool begins : {false, true}) ExpectStripComesBack(begins);
}

}  // namespace
}  // namespace cairn
