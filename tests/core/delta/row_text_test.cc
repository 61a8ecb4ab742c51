#include "core/delta/row_text.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/blob.h"
#include "core/packing/map_codes.h"
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
    ASSERT_TRUE(ReadRowText(WriteRowText(rows), &read));
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

// The bytes of one station, one image and one node, but for what is given.
struct OneOfEach {
  std::string station = {0, 0, 1, 0};        // at (0, 0), covered, no neighbours
  std::string image = {2, 0, 1, 'x', 3, 0};  // id 1, 'x', camera 3, no station
  std::string node = {1, 1, 0, 0, 0};        // kept, image 0, no links, no look-alikes
  size_t num_stations = 1, num_images = 1, num_nodes = 1;

  bool IsRead() const {
    BlobWriter rotation;
    WriteRotation(Eigen::Quaterniond::Identity(), &rotation);
    MapRows rows;
    rows.stations.resize(num_stations);
    rows.images.resize(num_images);
    rows.appearance.resize(num_nodes);
    return ReadRowText(
        station + (num_images > 0 ? image + rotation.Take() + std::string(12, '\0') : "") + node, &rows);
  }
};

std::string Bytes(std::initializer_list<uint8_t> list) { return {list.begin(), list.end()}; }

TEST(RowText, RefusesStationsThatMakeNoSense) {
  EXPECT_TRUE(OneOfEach().IsRead());
  const auto two = [](const std::string& first) {
    return OneOfEach{.station = first + Bytes({0, 0, 0, 0}), .num_stations = 2}.IsRead();
  };
  EXPECT_TRUE(two(Bytes({0, 0, 3, 0, 0})));      // a heading of 0
  EXPECT_FALSE(two(Bytes({0, 0, 4, 0})));        // no such flag
  EXPECT_TRUE(two(Bytes({0, 0, 1, 1, 1})));      // beside the next
  EXPECT_FALSE(two(Bytes({0, 0, 1, 1, 0})));     // beside itself
  EXPECT_FALSE(two(Bytes({0, 0, 1, 1, 2})));     // beside a third
  EXPECT_FALSE(two(Bytes({0, 0, 1, 2, 1, 1})));  // beside the next twice
  EXPECT_FALSE(two(Bytes({0, 0, 1, 0xff, 0x7f})));
}

TEST(RowText, RefusesImagesThatMakeNoSense) {
  const auto reads = [](const std::string& image) { return OneOfEach{.image = image}.IsRead(); };
  EXPECT_FALSE(reads(Bytes({0, 0, 1, 'x', 3, 0})));      // id 0
  EXPECT_FALSE(reads(Bytes({1, 0, 1, 'x', 3, 0})));      // id -1
  EXPECT_FALSE(reads(Bytes({2, 1, 1, 'x', 3, 0})));      // shares a byte with a name that is not there
  EXPECT_TRUE(reads(Bytes({2, 0, 0, 3, 1})));            // no name, at station 0
  EXPECT_FALSE(reads(Bytes({2, 0, 0, 3, 2})));           // at station 1 of 1
  EXPECT_FALSE(reads(Bytes({2, 0, 0x81, 0x20, 3, 0})));  // a name of 4097 bytes
  EXPECT_FALSE(reads(Bytes({2, 0, 0, 0x80, 0x80, 0x80, 0x80, 0x10, 0})));  // camera 2^32
  EXPECT_TRUE(reads(Bytes({0xfe, 0xff, 0xff, 0xff, 0x1f, 0, 0, 3, 0})));   // id 2^32 - 1
  EXPECT_FALSE(reads(Bytes({0x80, 0x80, 0x80, 0x80, 0x20, 0, 0, 3, 0})));  // id 2^32
}

TEST(RowText, RefusesNodesThatMakeNoSense) {
  const auto reads = [](const std::string& first) {
    return OneOfEach{.node = first + Bytes({0, 1, 1, 0, 0}), .num_nodes = 2}
        .IsRead();  // the other has image 0, too
  };
  EXPECT_TRUE(reads(Bytes({1, 1, 0, 0, 0})));
  EXPECT_FALSE(reads(Bytes({4, 1, 0, 0, 0})));                                   // no such flag
  EXPECT_FALSE(reads(Bytes({1, 0, 0, 0})));                                      // no image
  EXPECT_FALSE(reads(Bytes({1, 1, 2, 0, 0})));                                   // image 1 of 1
  EXPECT_FALSE(reads(Bytes({1, 1, 1, 0, 0})));                                   // image -1
  EXPECT_FALSE(reads(Bytes({1, 2, 0, 0, 0, 0})));                                // image 0 twice
  EXPECT_TRUE(reads(Bytes({1, 1, 0, 1, 1, 9, 0})));                              // linked to the other by 9
  EXPECT_FALSE(reads(Bytes({1, 1, 0, 1, 1, 0, 0})));                             // by none
  EXPECT_FALSE(reads(Bytes({1, 1, 0, 1, 0, 9, 0})));                             // to itself
  EXPECT_FALSE(reads(Bytes({1, 1, 0, 1, 2, 9, 0})));                             // to a third
  EXPECT_FALSE(reads(Bytes({1, 1, 0, 1, 1, 0x80, 0x80, 0x80, 0x80, 0x08, 0})));  // by 2^31
  EXPECT_TRUE(reads(Bytes({1, 1, 0, 0, 1, 1, 0xe8, 0x07})));                     // looks like it: 1
  EXPECT_FALSE(reads(Bytes({1, 1, 0, 0, 1, 1, 0xe9, 0x07})));                    // 1.001
  EXPECT_FALSE(reads(Bytes({1, 1, 0, 0, 1, 1, 0})));                             // 0
  EXPECT_TRUE(reads(Bytes({3, 0x80, 0xf4, 0x03, 1, 0, 0, 0})));                  // an entropy of 64
  EXPECT_FALSE(reads(Bytes({3, 0x81, 0xf4, 0x03, 1, 0, 0, 0})));                 // 64.001
}

TEST(RowText, IsReadToItsEndAndNoFarther) {
  const MapRows rows = SmallRows();
  const std::string text = WriteRowText(rows);
  for (size_t length = 0; length < text.size(); ++length) {
    MapRows read = Sized(rows);
    EXPECT_FALSE(ReadRowText(std::string_view(text).substr(0, length), &read)) << length;
  }
  MapRows read = Sized(rows);
  EXPECT_FALSE(ReadRowText(text + '\0', &read));
}

}  // namespace
}  // namespace cairn
