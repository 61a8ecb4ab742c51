// Maps with right seals whose contents are, or unfold to, more than a reader can take.
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/map/map_file.h"
#include "tests/core/map/full_rows.h"
#include "tests/core/map/sealed_blocks.h"

namespace cairn {
namespace {

using testing::HasSubstr;

std::string Path() { return testing::TempDir() + "/unfolding.cairn"; }

// The signed map with other station blocks, sealed again.
void WriteWithStations(const std::string& signed_path, const std::vector<StationBlock>& stations,
                       const std::string& path) {
  std::vector<BlockContents> blocks;
  for (const StationBlock& block : stations) {
    blocks.push_back(
        {BlockKind::kStations, static_cast<uint32_t>(block.stations.size()), EncodeBlock(block)});
  }
  for (BlockContents& block : BlocksOf(*MapFile::Open(signed_path, {}))) {
    if (block.kind != BlockKind::kStations) blocks.push_back(std::move(block));
  }
  const Status status = WriteSealedBlocks(*ReadFile(signed_path), blocks, path);
  ASSERT_TRUE(status.ok()) << status.error().message;
}

// Stations in blocks of 100, each with `num_neighbours` of the next as neighbours: a run is 3 bytes at
// any length.
std::vector<StationBlock> StationBlocks(int num_stations, int num_neighbours) {
  std::vector<StationBlock> blocks;
  for (int first = 0; first < num_stations; first += 100) {
    StationBlock& block = blocks.emplace_back();
    block.first = first;
    for (int i = first; i < first + 100; ++i) {
      block.stations.emplace_back();
      std::vector<StationIdx>& neighbours = block.neighbours.emplace_back();
      for (int other = i + 1; other < std::min(num_stations, i + 1 + num_neighbours); ++other)
        neighbours.push_back(other);
      block.regions.push_back(i == 0 ? std::vector<RegionIdx>{0, 1} : std::vector<RegionIdx>{});
    }
  }
  return blocks;
}

TEST(UnfoldingMap, ListsThatUnfoldToFarMoreThanTheFileAreRefused) {
  MapRows rows = FullRows();
  rows.findings = {};  // they count stations
  const std::string base = testing::TempDir() + "/unfolding_base.cairn";
  ASSERT_TRUE(WriteMapRows(rows, base).ok());
  WriteWithStations(base, StationBlocks(10'000, 4), Path());
  const Result<MapRows> few = ReadMapRows(Path());
  ASSERT_TRUE(few.ok()) << few.error().message;
  EXPECT_EQ(few->station_edges.size(), 39'990u);
  WriteWithStations(base, StationBlocks(10'000, 10'000), Path());  // 50 million edges in 240 kB
  const Result<MapRows> many = ReadMapRows(Path());
  ASSERT_FALSE(many.ok());
  EXPECT_EQ(many.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(many.error().message, HasSubstr("decode to more than 64 times its size"));
}

TEST(UnfoldingMap, MoreRegionsThanStationsAreRefusedBeforeTheyAreRead) {
  MapDirectory directory;
  directory.Add(
      {.kind = static_cast<uint8_t>(BlockKind::kStations), .first = 0, .count = 2, .num_bytes = 20});
  directory.Add(
      {.kind = static_cast<uint8_t>(BlockKind::kRegions), .first = 0, .count = 2049, .num_bytes = 20'000});
  EXPECT_THAT(MapDirectory::Decode(directory.Encode(), 100'000).error().message,
              HasSubstr("2049 regions of 2 stations"));
}

// Packed, a thousand that are alike take some bytes, and a robot that has nothing else to go by reads them
// all.
TEST(UnfoldingMap, LandmarksThatAreAllAlikeAreCounted) {
  const std::string base = testing::TempDir() + "/unfolding_base.cairn";
  ASSERT_TRUE(WriteMapRows(FullRows(), base).ok());
  std::vector<BlockContents> blocks;
  for (int i = 0; i < 1000; ++i) blocks.push_back({BlockKind::kLandmarks, 1024, "few", true});
  const MapFile file = *MapFile::Open(base, {});
  for (BlockContents& block : BlocksOf(file)) {
    if (block.kind != BlockKind::kLandmarks && block.kind != BlockKind::kLandmarkModels)
      blocks.push_back(std::move(block));
  }
  ASSERT_TRUE(WriteSealedBlocks(*ReadFile(base), blocks, Path()).ok());
  const Result<MapFile> many = MapFile::Open(Path(), {});
  ASSERT_FALSE(many.ok());
  EXPECT_EQ(many.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(many.error().message, HasSubstr("1024000 landmarks, more than a map of"));
}

TEST(UnfoldingMap, SessionsAreBounded) {
  MapRows rows = FullRows();
  rows.sessions.resize(1001);
  for (size_t i = 0; i < rows.sessions.size(); ++i) rows.sessions[i] = "day" + std::to_string(i);
  EXPECT_THAT(WriteMapRows(rows, Path()).error().message, HasSubstr("1001 sessions, at most 1000"));
  rows.sessions.pop_back();
  EXPECT_TRUE(WriteMapRows(rows, Path()).ok());
}

TEST(UnfoldingMap, ModelsOfMoreSightsThanAreSolvedInTimeAreRefused) {
  MapRows rows = FullRows();
  HeadingModel& model = rows.visual_map.landmarks[0][0];
  const MapImage image = rows.images.back();
  while (rows.images.size() < 513) {
    rows.images.push_back(image);
    rows.images.back().image_id = rows.images[rows.images.size() - 2].image_id + 1;
    rows.images.back().landmarks.clear();
  }
  model.sights.clear();
  for (int32_t i = 0; i < 513; ++i) model.sights.push_back({i, {100, 50, 1}});
  EXPECT_THAT(WriteMapRows(rows, Path()).error().message, HasSubstr("513 sights, expected 3 to 512"));
  model.sights.pop_back();
  EXPECT_TRUE(WriteMapRows(rows, Path()).ok()) << WriteMapRows(rows, Path()).error().message;
}

TEST(UnfoldingMap, RegionsOfNoStationAreRefused) {
  MapRows rows = FullRows();
  rows.regions[0].stations.clear();
  EXPECT_THAT(WriteMapRows(rows, Path()).error().message, HasSubstr("region 0 has no station"));
  rows = FullRows();
  rows.findings.promise.reset();
  while (rows.regions.size() <= rows.stations.size()) rows.regions.push_back(rows.regions[0]);
  EXPECT_THAT(WriteMapRows(rows, Path()).error().message, HasSubstr("4 regions of 3 stations"));
}

}  // namespace
}  // namespace cairn
