#include "core/delta/row_text.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/delta/two_maps.h"

namespace cairn {
namespace {

MapRows Sized(const MapRows& like) {
  MapRows rows;
  rows.stations.resize(like.stations.size());
  rows.images.resize(like.images.size());
  rows.appearance.resize(like.appearance.size());
  return rows;
}

TEST(RowText, ReadsWhatWasWritten) {
  for (const MapRows& rows : {SmallRows(), ChangedRows()}) {
    MapRows read = Sized(rows);
    ASSERT_TRUE(ReadRowText(WriteRowText(rows), "text", &read).ok());
    for (size_t i = 0; i < rows.stations.size(); ++i) {
      EXPECT_EQ(read.stations[i].position, rows.stations[i].position);
      EXPECT_EQ(read.stations[i].heading_deg, rows.stations[i].heading_deg);
      EXPECT_EQ(read.stations[i].is_covered, rows.stations[i].is_covered);
    }
    EXPECT_EQ(read.station_edges, rows.station_edges);
    for (size_t i = 0; i < rows.images.size(); ++i) {
      EXPECT_EQ(read.images[i].image_id, rows.images[i].image_id);
      EXPECT_EQ(read.images[i].name, rows.images[i].name);
      EXPECT_EQ(read.images[i].camera_id, rows.images[i].camera_id);
      EXPECT_EQ(read.images[i].station, rows.images[i].station);
      EXPECT_EQ(read.images[i].cam_from_world.translation, rows.images[i].cam_from_world.translation);
      EXPECT_EQ(read.images[i].cam_from_world.rotation.coeffs(),
                rows.images[i].cam_from_world.rotation.coeffs());
    }
    EXPECT_EQ(read.appearance, rows.appearance);
  }
}

TEST(RowText, LeavesWhatImagesSee) {
  const MapRows rows = SmallRows();
  MapRows read = Sized(rows);
  read.images[1].landmarks = {4};
  ASSERT_TRUE(ReadRowText(WriteRowText(rows), "text", &read).ok());
  EXPECT_THAT(read.images[1].landmarks, testing::ElementsAre(4));
  EXPECT_THAT(read.images[0].landmarks, testing::IsEmpty());
}

TEST(RowText, HasNoEntropiesWhereNoneAreKnown) {
  MapRows rows = SmallRows();
  for (MapAppearanceNode& node : rows.appearance) {
    node.entropy.reset();
    node.look_alikes.clear();
  }
  MapRows read = Sized(rows);
  ASSERT_TRUE(ReadRowText(WriteRowText(rows), "text", &read).ok());
  EXPECT_EQ(read.appearance, rows.appearance);
  rows = {};
  EXPECT_TRUE(ReadRowText(WriteRowText(rows), "text", &rows).ok()) << "nothing at all";
}

// What blocks are refused for is tested with them (map_blocks_test.cc): here, that each kind is read as one.
TEST(RowText, RefusesWhatMakesNoSense) {
  const MapRows rows = SmallRows();
  for (const auto& change : std::vector<std::function<void(MapRows*)>>{
           [](MapRows* made) { made->stations.push_back({}); },
           [](MapRows* made) { made->stations.pop_back(); },
           [](MapRows* made) { made->images.push_back({}); }, [](MapRows* made) { made->images.pop_back(); },
           [](MapRows* made) { made->appearance.push_back({}); },
           [](MapRows* made) { made->appearance.pop_back(); }}) {
    MapRows read = Sized(rows);
    change(&read);
    const Status status = ReadRowText(WriteRowText(rows), "text", &read);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(status.error().message, testing::HasSubstr("text"));
  }
  for (const auto& lie : std::vector<std::function<void(MapRows*)>>{
           [](MapRows* lying) { lying->images[1].station = 3; },
           [](MapRows* lying) { lying->images[1].image_id = 1; },
           [](MapRows* lying) { lying->images[1].name = std::string(kMaxNameBytes + 1, 'a'); },
           [](MapRows* lying) { lying->images[1].cam_from_world.translation.x() = 2.1e5; },
           [](MapRows* lying) {
             lying->station_edges = {{0, 3}};
           },
           [](MapRows* lying) { lying->stations[2].position.y() = -2.1e5; },
           [](MapRows* lying) { lying->appearance[0].links[0].num_inliers = 0; },
           [](MapRows* lying) { lying->appearance[1].images = {}; },
           [](MapRows* lying) { lying->appearance[2].images = {4}; },
           [](MapRows* lying) { lying->appearance[0].look_alikes[0].score = 1.001; },
           [](MapRows* lying) { lying->appearance[1].entropy = 64.001; }}) {
    MapRows lying = rows, read = Sized(rows);
    lie(&lying);
    EXPECT_FALSE(ReadRowText(WriteRowText(lying), "text", &read).ok());
  }
}

TEST(RowText, IsReadToItsEndAndNoFarther) {
  const MapRows rows = SmallRows();
  const std::string text = WriteRowText(rows);
  for (size_t length = 0; length < text.size(); ++length) {
    MapRows read = Sized(rows);
    EXPECT_FALSE(ReadRowText(std::string_view(text).substr(0, length), "text", &read).ok()) << length;
  }
  MapRows read = Sized(rows);
  EXPECT_FALSE(ReadRowText(text + '\0', "text", &read).ok());
}

}  // namespace
}  // namespace cairn
