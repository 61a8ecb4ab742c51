#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/atlas/atlas_file.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "runtime/atlas/atlas.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {

// Three rooms whose walls show other things, and their atlas, without look-alikes.
class ThreeRoomsTest : public testing::Test {
 protected:
  static constexpr int kNumRooms = 3;

  static const SyntheticRoom& Room(int room) {
    static const std::vector<SyntheticRoom> rooms = {MakeSyntheticRoom(11), MakeSyntheticRoom(12),
                                                     MakeSyntheticRoom(13)};
    return rooms[room];
  }

  static std::string Path(const std::string& name) { return testing::TempDir() + "/rooms_" + name; }

  static void SetUpTestSuite() {
    for (int room = 0; room < kNumRooms; ++room) {
      MapRows rows = Room(room).rows;
      rows.name = "room " + std::to_string(room);
      ASSERT_TRUE(WriteMapRows(rows, Path(std::to_string(room) + ".cairn")).ok());
    }
  }

  // Every seventh landmark of each room, of all four walls, 32 at a place.
  static AtlasRows Rows() {
    constexpr size_t kStride = 7;
    AtlasRows atlas;
    atlas.name = "rooms";
    DescriptorMatrix all(0, kSiftDescriptorDim);
    for (int room = 0; room < kNumRooms; ++room) {
      const DescriptorMatrix& more = Room(room).descriptors;
      all.conservativeResize(all.rows() + more.rows(), kSiftDescriptorDim);
      all.bottomRows(more.rows()) = more;
    }
    atlas.code_book = LearnCodeBook(all);
    for (int room = 0; room < kNumRooms; ++room) {
      const std::string file = std::to_string(room) + ".cairn";
      AtlasMap map{.name = "room " + std::to_string(room),
                   .file = "rooms_" + file,
                   .fingerprint = FingerprintOf(MapFile::Open(Path(file), {})->seal().root),
                   .num_images = static_cast<int64_t>(Room(room).rows.images.size())};
      std::vector<uint32_t> codes;
      for (size_t i = 0; i < Room(room).points.size(); i += kStride) {
        if (codes.size() == 32) map.places.push_back(std::exchange(codes, {}));
        codes.push_back(
            CodeOf(atlas.code_book, Room(room).descriptors.row(static_cast<Eigen::Index>(i)).data()).bits);
      }
      map.places.push_back(codes);
      for (std::vector<uint32_t>& place : map.places) std::sort(place.begin(), place.end());
      atlas.maps.push_back(std::move(map));
    }
    return atlas;
  }

  static std::shared_ptr<const Atlas> Open(AtlasRows rows, const AtlasOptions& options = {}) {
    EXPECT_TRUE(WriteFileAtomically(Path("of.atlas"), *EncodeAtlas(std::nullopt, &rows)).ok());
    auto atlas = Atlas::Open(Path("of.atlas"), options);
    EXPECT_TRUE(atlas.ok()) << atlas.error().message;
    return *atlas;
  }

  static Features See(int room, const Pose& pose, uint64_t seed) {
    return RenderFeatures(Room(room), pose, {}, seed);
  }
};

}  // namespace cairn
