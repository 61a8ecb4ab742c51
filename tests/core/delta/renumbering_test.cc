#include "core/delta/renumbering.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/core/delta/two_maps.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr int32_t kNew = Renumbering::kNew;

TEST(FindSame, LandmarksByAllThatIsStoredOfThem) {
  MapRows from = SmallRows();
  EXPECT_THAT(FindSame(from, from).landmarks, ElementsAre(0, 1, 2, 3, 4));
  for (const auto& change : std::vector<std::function<void(MapRows*)>>{
           [](MapRows* rows) { rows->landmarks[2].class_id = 99; },
           [](MapRows* rows) { rows->landmarks[2].position.y() += 1e-4; },
           [](MapRows* rows) { rows->landmarks[2].covariance(0, 0) *= 2; },
           [](MapRows* rows) { rows->landmarks[2].scale_m = 0; },
           [](MapRows* rows) { ++rows->landmarks[2].num_observations; },
           [](MapRows* rows) { ++rows->descriptors(2, 127); }}) {
    MapRows to = from;
    change(&to);
    EXPECT_THAT(FindSame(from, to).landmarks, ElementsAre(0, 1, kNew, 3, 4));
  }
}

TEST(FindSame, ElementsWhateverTheirNumbers) {
  const MapRows from = SmallRows(), to = ChangedRows();
  const Renumbering same = FindSame(from, to);
  EXPECT_THAT(same.landmarks, ElementsAre(0, 2, kNew, 3, 4, kNew));
  EXPECT_THAT(same.images, ElementsAre(0, kNew, 2, 3));
  EXPECT_THAT(same.stations, ElementsAre(kNew, 0, 2));
  EXPECT_THAT(same.nodes, ElementsAre(0, kNew, 2));
}

TEST(FindSame, StationsByPlaceAndHeadingEachOnce) {
  MapRows from, to;
  from.stations = {{.position = {1, 2}, .heading_deg = 90}, {.position = {1, 2}}, {.position = {1, 2}}};
  to.stations = {{.position = {1, 2}}, {.position = {1, 2}, .heading_deg = 91}, {.position = {1, 2}},
                 {.position = {1, 2}}, {.position = {1, 2}, .heading_deg = 90}, {.position = {2, 1}}};
  EXPECT_THAT(FindSame(from, to).stations, ElementsAre(1, kNew, 2, kNew, 0, kNew));
}

TEST(Renumbered, NamesElementsByTheirNewNumbers) {
  const MapRows from = SmallRows(), to = ChangedRows();
  const MapRows rows = Renumbered(from, FindSame(from, to));
  ASSERT_EQ(rows.images.size(), 4U);
  EXPECT_EQ(rows.images[0].name, "a/1.jpg");
  EXPECT_THAT(rows.images[0].landmarks, ElementsAre(0, 1));
  EXPECT_EQ(rows.images[0].station, 1);
  EXPECT_EQ(rows.images[1].image_id, 0U);
  EXPECT_THAT(rows.images[1].landmarks, IsEmpty());
  EXPECT_EQ(rows.images[2].station, -1) << "its station is not in the other map";
  EXPECT_THAT(rows.images[2].landmarks, ElementsAre(1, 3));
  EXPECT_THAT(rows.images[3].landmarks, ElementsAre(3, 4));
  ASSERT_EQ(rows.stations.size(), 3U);
  EXPECT_EQ(rows.stations[0].position, Eigen::Vector2d::Zero()) << "new";
  EXPECT_EQ(rows.stations[1].position, from.stations[0].position);
  EXPECT_EQ(rows.stations[2].position, from.stations[2].position);
  EXPECT_THAT(rows.station_edges, ElementsAre(std::pair(1, 2)));
  ASSERT_EQ(rows.regions.size(), 2U);
  EXPECT_THAT(rows.regions[0].stations, ElementsAre(1));
  EXPECT_THAT(rows.regions[0].landmarks, ElementsAre(0, 1));
  EXPECT_THAT(rows.regions[1].stations, ElementsAre(2));
  EXPECT_THAT(rows.regions[1].landmarks, ElementsAre(1, 3, 4));
  ASSERT_EQ(rows.appearance.size(), 3U);
  EXPECT_THAT(rows.appearance[0].images, ElementsAre(0));
  EXPECT_TRUE(rows.appearance[0].is_kept);
  EXPECT_EQ(rows.appearance[0].entropy, 0.25);
  EXPECT_THAT(rows.appearance[0].links, ElementsAre(MapAppearanceNode::Link{2, 30}));
  EXPECT_THAT(rows.appearance[0].look_alikes, ElementsAre(MapAppearanceNode::LookAlike{2, 0.5}));
  EXPECT_EQ(rows.appearance[1], (MapAppearanceNode{.entropy = 0})) << "new";
  EXPECT_THAT(rows.appearance[2].images, ElementsAre(2, 3));
}

TEST(Renumbered, UnderItsOwnNumbersAMapStaysAsItIs) {
  const MapRows from = SmallRows(), rows = Renumbered(from, FindSame(from, from));
  for (size_t i = 0; i < from.stations.size(); ++i) {
    EXPECT_EQ(rows.stations[i].position, from.stations[i].position);
    EXPECT_EQ(rows.stations[i].heading_deg, from.stations[i].heading_deg);
  }
  for (size_t i = 0; i < from.images.size(); ++i) {
    EXPECT_EQ(rows.images[i].station, from.images[i].station);
    EXPECT_EQ(rows.images[i].landmarks, from.images[i].landmarks);
  }
  EXPECT_EQ(rows.station_edges, from.station_edges);
  EXPECT_EQ(rows.appearance, from.appearance);
}

TEST(Renumbered, LinksStandAtTheSmallerNodeWhateverTheOrder) {
  MapRows from = SmallRows();
  const MapRows rows =
      Renumbered(from, {.landmarks = {}, .images = {0, 1, 2, 3}, .stations = {}, .nodes = {2, 1, 0}});
  EXPECT_THAT(rows.appearance[0].images, ElementsAre(2, 3));
  EXPECT_THAT(rows.appearance[0].links,
              ElementsAre(MapAppearanceNode::Link{1, 40}, MapAppearanceNode::Link{2, 30}));
  EXPECT_THAT(rows.appearance[1].links, ElementsAre(MapAppearanceNode::Link{2, 20}));
  EXPECT_THAT(rows.appearance[2].links, IsEmpty());
  EXPECT_THAT(rows.appearance[0].look_alikes, ElementsAre(MapAppearanceNode::LookAlike{2, 0.5}));
}

std::string Written(const Renumbering& renumbering) {
  BlobWriter writer;
  WriteRenumbering(renumbering, &writer);
  return writer.Take();
}

TEST(WriteRenumbering, TakesTwoBytesForARun) {
  // 0 and 1; one new; 3 and 4: after 2 comes 3, a step of 1; then back to 2, a step of -3.
  const Renumbering some{
      .landmarks = {0, 1, kNew, 3, 4, 2}, .images = {}, .stations = {kNew, kNew}, .nodes = {}};
  EXPECT_EQ(Written(some), std::string("\x06\x04\x00\x03\x04\x02\x02\x05\x00\x02\x05\x00", 12));
}

TEST(ReadRenumbering, ReadsWhatWasWritten) {
  const MapRows from = SmallRows();
  const Renumbering all{
      .landmarks = {4, kNew, 0, 1, 3, kNew}, .images = {3, 2}, .stations = {kNew}, .nodes = {0, kNew, 2}};
  const std::string bytes = Written(all);
  BlobReader reader(bytes);
  const Renumbering read = ReadRenumbering(from, 6, &reader);
  EXPECT_TRUE(reader.Finished());
  EXPECT_EQ(read.landmarks, all.landmarks);
  EXPECT_EQ(read.images, all.images);
  EXPECT_EQ(read.stations, all.stations);
  EXPECT_EQ(read.nodes, all.nodes);
  BlobReader again(bytes);
  ReadRenumbering(from, 5, &again);
  EXPECT_FALSE(again.ok()) << "6 landmarks are more than 5";
}

TEST(ReadRenumbering, RefusesWhatIsNotThere) {
  const MapRows from = SmallRows();  // five landmarks
  const auto reads = [&](std::string landmarks) {
    const std::string bytes = landmarks + std::string(3, '\0');
    BlobReader reader(bytes);
    ReadRenumbering(from, 1000, &reader);
    return reader.Finished();
  };
  const auto bytes = [](std::initializer_list<uint8_t> list) {
    return std::string(list.begin(), list.end());
  };
  EXPECT_TRUE(reads(bytes({5, 10, 0})));        // 0 .. 4
  EXPECT_FALSE(reads(bytes({6, 12, 0})));       // 0 .. 5
  EXPECT_FALSE(reads(bytes({1, 2, 1})));        // -1
  EXPECT_TRUE(reads(bytes({1, 2, 8})));         // 4
  EXPECT_FALSE(reads(bytes({1, 2, 10})));       // 5
  EXPECT_FALSE(reads(bytes({1, 2, 12})));       // a step of 6
  EXPECT_FALSE(reads(bytes({2, 2, 0, 2, 1})));  // 0 twice
  EXPECT_FALSE(reads(bytes({1, 0, 0})));        // an empty run
  EXPECT_FALSE(reads(bytes({1, 3 + 2})));       // two new ones of one
  EXPECT_FALSE(reads(bytes({3, 5, 5})));        // two more of three
  EXPECT_FALSE(reads(bytes({5, 10})));          // cut off
  EXPECT_FALSE(reads(bytes({1, 2, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1})));
}

}  // namespace
}  // namespace cairn
