#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "core/delta/map_delta.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "runtime/map/update_map.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {

// The map of a room, and that of the room after the first of its eight regions was surveyed again: other
// landmarks there.
class UpdateMapTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    SyntheticRoom room = MakeSyntheticRoom(3);
    ASSERT_TRUE(WriteMapRows(room.rows, Path("old.cairn")).ok());
    Random random(1);
    for (const LandmarkIdx landmark : room.rows.regions[0].landmarks) {
      room.rows.landmarks[landmark].position.x() += random.Normal(0, 0.02);
      room.rows.descriptors.row(landmark) = RandomDescriptor(random);
    }
    room.rows.name = "room, again";
    ASSERT_TRUE(WriteMapRows(room.rows, Path("new.cairn")).ok());
  }

  void SetUp() override {
    for (const char* name : {"made.cairn", "never.cairn", "key.cairn"}) std::filesystem::remove(Path(name));
  }

  static std::string Path(const std::string& name) { return testing::TempDir() + "/update_" + name; }

  // A delta from old.cairn to new.cairn under this name.
  static std::string WriteDelta(const std::string& name, const std::optional<SecretKey>& key = std::nullopt) {
    EXPECT_TRUE(WriteFileAtomically(Path(name),
                                    EncodeMapDelta(*MakeMapDelta(Path("old.cairn"), Path("new.cairn"), key)))
                    .ok());
    return Path(name);
  }

  // A fresh copy of a map under another name.
  static std::string Copy(const std::string& name, const std::string& copy) {
    std::filesystem::copy_file(Path(name), Path(copy), std::filesystem::copy_options::overwrite_existing);
    std::filesystem::remove(PreviousMapPath(Path(copy)));
    return Path(copy);
  }
};

}  // namespace cairn
