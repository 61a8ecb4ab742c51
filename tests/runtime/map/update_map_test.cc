#include "runtime/map/update_map.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/map/map_delta.h"
#include "core/map/map_file.h"
#include "runtime/map/map.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The map of a room, and that of the room after the first of its eight regions was surveyed anew: other
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
    for (const char* name : {"made.cairn", "never.cairn", "key.cairn"}) fs::remove(Path(name));
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
    fs::copy_file(Path(name), Path(copy), fs::copy_options::overwrite_existing);
    fs::remove(PreviousMapPath(Path(copy)));
    return Path(copy);
  }
};

TEST_F(UpdateMapTest, MakesTheSameBytesAndCostsWhatChanged) {
  const std::string delta = WriteDelta("delta");
  ASSERT_TRUE(ApplyDelta(Path("old.cairn"), delta, Path("made.cairn")).ok());
  EXPECT_EQ(*ReadFile(Path("made.cairn")), *ReadFile(Path("new.cairn")));
  // An eighth of the map's landmarks is new, and whatever is new has to travel: descriptors do not shrink.
  const Result<std::shared_ptr<const Map>> map = Map::Open(Path("new.cairn"));
  const double new_ratio =
      static_cast<double>((*ReadMapRows(Path("new.cairn"))).regions[0].landmarks.size()) /
      static_cast<double>((*map)->num_landmarks());
  const double ratio =
      static_cast<double>(fs::file_size(delta)) / static_cast<double>(fs::file_size(Path("new.cairn")));
  EXPECT_LT(ratio, 1.2 * new_ratio);
  EXPECT_GT(ratio, 0.3 * new_ratio);
}

TEST_F(UpdateMapTest, SameMapsMakeASmallDeltaAndTheSameBytes) {
  const std::string bytes = EncodeMapDelta(*MakeMapDelta(Path("new.cairn"), Path("new.cairn"), std::nullopt));
  EXPECT_LT(bytes.size(), 600U);
  ASSERT_TRUE(WriteFileAtomically(Path("none"), bytes).ok());
  ASSERT_TRUE(ApplyDelta(Path("new.cairn"), Path("none"), Path("same.cairn")).ok());
  EXPECT_EQ(*ReadFile(Path("same.cairn")), *ReadFile(Path("new.cairn")));
  EXPECT_EQ(EncodeMapDelta(*MakeMapDelta(Path("new.cairn"), Path("new.cairn"), std::nullopt)), bytes);
}

TEST_F(UpdateMapTest, AnotherMapIsRefusedWithASentence) {
  const std::string delta = WriteDelta("delta");
  const Status status = ApplyDelta(Path("new.cairn"), delta, Path("made.cairn"));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(status.error().message, HasSubstr("map 'room, again'"));
  EXPECT_THAT(status.error().message, HasSubstr("ask for a delta from this map"));
  // Both are named by the first eight bytes of their hashes.
  const MapDelta read = ReadMapDelta(delta, std::nullopt).value();
  const auto first_bytes = [](const Hash& hash) {
    return fmt::format("{:02x}{:02x}{:02x}{:02x}{:02x}{:02x}{:02x}{:02x}...", hash[0], hash[1], hash[2],
                       hash[3], hash[4], hash[5], hash[6], hash[7]);
  };
  EXPECT_THAT(status.error().message, HasSubstr("with the hash " + first_bytes(read.new_hash)));
  EXPECT_THAT(status.error().message, HasSubstr("bytes with " + first_bytes(read.old_hash)));
  EXPECT_FALSE(fs::exists(Path("made.cairn")));
  EXPECT_EQ(ApplyDelta(Path("no.cairn"), delta, Path("made.cairn")).error().code, ErrorCode::kNotFound);
}

TEST_F(UpdateMapTest, TruncatedAndFlippedDeltasMakeNothing) {
  const std::string bytes = *ReadFile(WriteDelta("delta"));
  const auto refused = [&](const std::string& broken) {
    std::FILE* const file = std::fopen(Path("broken").c_str(), "wb");
    std::fwrite(broken.data(), 1, broken.size(), file);
    std::fclose(file);
    const Status status = ApplyDelta(Path("old.cairn"), Path("broken"), Path("never.cairn"));
    return !status.ok() && !fs::exists(Path("never.cairn"));
  };
  EXPECT_TRUE(refused(""));
  EXPECT_TRUE(refused("What I wrote last night.\n"));
  EXPECT_TRUE(refused(bytes + "x"));
  // Whoever has a later delta is told so, and who has something else, that it is none.
  const auto reading = [&](const std::string& text) {
    EXPECT_TRUE(WriteFileAtomically(Path("broken"), text).ok());
    return ReadMapDelta(Path("broken"), std::nullopt).error().message;
  };
  std::string later = bytes;
  later[15] = '2';
  EXPECT_THAT(reading(later), HasSubstr("a delta of a later format"));
  std::string other = bytes;
  other[14] = 'A';
  EXPECT_THAT(reading(other), HasSubstr("is no delta of maps"));
  EXPECT_THAT(reading(bytes.substr(0, 15)), HasSubstr("15 bytes, its head alone has more"));
  // All lengths of the head, and some of the rest.
  for (size_t length = 0; length < 260; ++length) EXPECT_TRUE(refused(bytes.substr(0, length))) << length;
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const size_t length = random.UniformInt(0, bytes.size() - 1);
    EXPECT_TRUE(refused(bytes.substr(0, length))) << length;
  }
  for (int i = 0; i < 2000; ++i) {
    const size_t bit = i < 1000 ? random.UniformInt(0, 8 * 260) : random.UniformInt(0, 8 * bytes.size() - 1);
    std::string flipped = bytes;
    flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ 1 << bit % 8);
    EXPECT_TRUE(refused(flipped)) << "bit " << bit;
  }
}

// Somebody who writes deltas by hand can make the hash of the payload right.
TEST_F(UpdateMapTest, HostileDeltasAreRefused) {
  const MapDelta good = *MakeMapDelta(Path("old.cairn"), Path("new.cairn"), std::nullopt);
  const auto code = [&](const std::function<void(MapDelta*)>& change) {
    MapDelta bad = good;
    change(&bad);
    EXPECT_TRUE(WriteFileAtomically(Path("hostile"), EncodeMapDelta(bad)).ok());
    const Status status = ApplyDelta(Path("old.cairn"), Path("hostile"), Path("never.cairn"));
    EXPECT_FALSE(fs::exists(Path("never.cairn")));
    return status.ok() ? ErrorCode{} : status.error().code;
  };
  EXPECT_EQ(code([](MapDelta* delta) { delta->payload = ""; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->payload.resize(delta->payload.size() / 2); }),
            ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->payload += delta->payload; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->new_num_bytes = uint64_t{1} << 40; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->new_num_bytes += delta->new_page_size; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->new_num_bytes -= delta->new_page_size; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->new_page_size = 0; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->new_page_size = 512; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->old_page_size = 3; }), ErrorCode::kCorrupt);
  // A state that no map can have is refused as that, before anything is unfolded.
  const auto states = [&](const std::function<void(MapDelta*)>& change) {
    MapDelta bad = good;
    change(&bad);
    EXPECT_TRUE(WriteFileAtomically(Path("hostile"), EncodeMapDelta(bad)).ok());
    const Result<MapDelta> read = ReadMapDelta(Path("hostile"), std::nullopt);
    return read.ok() ? "read" : read.error().message;
  };
  for (const std::function<void(MapDelta*)>& change : std::vector<std::function<void(MapDelta*)>>{
           [](MapDelta* delta) { delta->old_num_bytes = 0; },
           [](MapDelta* delta) { delta->new_num_bytes = 0; },
           [](MapDelta* delta) { delta->new_num_bytes += 1; },
           [](MapDelta* delta) { delta->new_page_size = 256; },
           [](MapDelta* delta) { delta->new_page_size = 131072; },
           [](MapDelta* delta) { delta->new_page_size = 3000; },
           [](MapDelta* delta) { delta->new_num_bytes = uint64_t{1} << 40; }})
    EXPECT_THAT(states(change), HasSubstr("states a map of"));
  for (const uint32_t page_size : {512u, 65536u})
    EXPECT_EQ(
        states([&](MapDelta* delta) { delta->new_page_size = page_size, delta->new_num_bytes = 65536; }),
        "read");
  EXPECT_EQ(code([](MapDelta* delta) { delta->old_num_bytes = delta->old_page_size; }),
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(code([](MapDelta* delta) { delta->new_hash[5] ^= 1; }), ErrorCode::kCorrupt);
  EXPECT_TRUE(WriteFileAtomically(Path("hostile"), EncodeMapDelta(good)).ok());
  EXPECT_TRUE(ApplyDelta(Path("old.cairn"), Path("hostile"), Path("made.cairn")).ok());
}

TEST_F(UpdateMapTest, ForgedAndUnsignedDeltasAreRefusedWhereAKeyIsRequired) {
  const KeyPair keys = MakeKeyPair(), others = MakeKeyPair();
  Copy("new.cairn", "unsigned.cairn");
  const auto code = [&](const std::string& delta, const PublicKey& required) {
    const Status status = ApplyDelta(Path("old.cairn"), delta, Path("key.cairn"), {.public_key = required});
    return status.ok() ? ErrorCode{} : status.error().code;
  };
  EXPECT_EQ(code(WriteDelta("delta"), keys.public_key), ErrorCode::kNotSigned);
  const std::string signed_delta = WriteDelta("signed", keys.secret_key);
  EXPECT_EQ(code(signed_delta, others.public_key), ErrorCode::kWrongKey);
  // The delta is signed, but the map that it leads to is not: a robot with the key could not open it.
  EXPECT_EQ(code(signed_delta, keys.public_key), ErrorCode::kNotSigned);
  EXPECT_FALSE(fs::exists(Path("key.cairn")));
  ASSERT_TRUE(SignMap(Path("new.cairn"), keys.secret_key, Path("signed.cairn")).ok());
  MapDelta delta = *MakeMapDelta(Path("old.cairn"), Path("signed.cairn"), keys.secret_key);
  ASSERT_TRUE(WriteFileAtomically(Path("both"), EncodeMapDelta(delta)).ok());
  EXPECT_EQ(code(Path("both"), keys.public_key), ErrorCode{});
  EXPECT_EQ(*ReadFile(Path("key.cairn")), *ReadFile(Path("signed.cairn")));
  delta.public_key = others.public_key;
  ASSERT_TRUE(WriteFileAtomically(Path("both"), EncodeMapDelta(delta)).ok());
  EXPECT_EQ(code(Path("both"), others.public_key), ErrorCode::kWrongKey);
}

TEST_F(UpdateMapTest, InPlaceKeepsTheOldMapAndRollsBack) {
  const std::string map = Copy("old.cairn", "robot.cairn");
  const std::string old_bytes = *ReadFile(map), new_bytes = *ReadFile(Path("new.cairn"));
  EXPECT_EQ(RollBackMap(map).error().code, ErrorCode::kNotFound);
  const auto open = Map::Open(map, {.memory_budget_bytes = 0});  // a robot that is driving
  ASSERT_TRUE(open.ok());
  const std::string delta = WriteDelta("delta");
  const Result<bool> updated = UpdateMap(map, delta);
  ASSERT_TRUE(updated.ok()) << updated.error().message;
  EXPECT_TRUE(*updated);
  EXPECT_EQ(*ReadFile(map), new_bytes);
  EXPECT_EQ(*ReadFile(PreviousMapPath(map)), old_bytes);
  EXPECT_EQ((*open)->head().name, "room");
  for (int64_t block = 0; block < (*open)->directory().NumBlocks(BlockKind::kLandmarks); ++block)
    EXPECT_TRUE((*open)->Landmarks(block).ok());
  // Sent twice.
  EXPECT_FALSE(*UpdateMap(map, delta));
  EXPECT_EQ(*ReadFile(PreviousMapPath(map)), old_bytes);
  ASSERT_TRUE(RollBackMap(map).ok());
  EXPECT_EQ(*ReadFile(map), old_bytes);
  EXPECT_EQ(*ReadFile(PreviousMapPath(map)), new_bytes);
  ASSERT_TRUE(RollBackMap(map).ok());
  EXPECT_EQ(*ReadFile(map), new_bytes);
}

TEST_F(UpdateMapTest, DamagedPreviousMapIsNotRolledBackTo) {
  const std::string map = Copy("old.cairn", "robot.cairn");
  ASSERT_TRUE(UpdateMap(map, WriteDelta("delta")).ok());
  std::string bytes = *ReadFile(PreviousMapPath(map));
  bytes[bytes.size() - 100] ^= 1;
  ASSERT_TRUE(WriteFileAtomically(PreviousMapPath(map), bytes).ok());
  EXPECT_EQ(RollBackMap(map).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("new.cairn")));
}

// Two at once would both keep what the first one made as the map before.
TEST_F(UpdateMapTest, OneUpdateAtATime) {
  const std::string map = Copy("old.cairn", "robot.cairn"), delta = WriteDelta("delta");
  const int folder = open(testing::TempDir().c_str(), O_RDONLY | O_DIRECTORY);
  ASSERT_EQ(flock(folder, LOCK_EX | LOCK_NB), 0);
  EXPECT_EQ(UpdateMap(map, delta).error().code, ErrorCode::kBusy);
  EXPECT_EQ(RollBackMap(map).error().code, ErrorCode::kBusy);
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("old.cairn")));
  close(folder);
  EXPECT_TRUE(UpdateMap(map, delta).ok());
}

TEST_F(UpdateMapTest, LinksLeadToTheMapAndNeverReplaceIt) {
  const std::string map = Copy("old.cairn", "robot.cairn"), delta = WriteDelta("delta");
  fs::create_symlink(map, PreviousMapPath(map));  // would keep the new map as the one before
  fs::remove(Path("link.cairn"));
  fs::create_symlink(map, Path("link.cairn"));
  ASSERT_TRUE(UpdateMap(Path("link.cairn"), delta).ok());
  EXPECT_TRUE(fs::is_symlink(Path("link.cairn")));
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("new.cairn")));
  EXPECT_FALSE(fs::is_symlink(PreviousMapPath(map)));
  EXPECT_EQ(*ReadFile(PreviousMapPath(map)), *ReadFile(Path("old.cairn")));
  ASSERT_TRUE(RollBackMap(Path("link.cairn")).ok());
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("old.cairn")));
}

TEST_F(UpdateMapTest, WhatKilledUpdatesLeftIsRemoved) {
  const std::string map = Copy("old.cairn", "robot.cairn");
  for (const std::string& stale :
       std::vector<std::string>{map + ".tmp-99999", PreviousMapPath(map) + ".tmp-99999"})
    ASSERT_TRUE(WriteFileAtomically(stale, "half a map").ok());
  ASSERT_TRUE(UpdateMap(map, WriteDelta("delta")).ok());
  EXPECT_FALSE(fs::exists(map + ".tmp-99999"));
  EXPECT_FALSE(fs::exists(PreviousMapPath(map) + ".tmp-99999"));
}

TEST_F(UpdateMapTest, OwnerAndModeOfTheMapStay) {
  const std::string map = Copy("old.cairn", "robot.cairn");
  ASSERT_EQ(chmod(map.c_str(), 0640), 0);
  if (geteuid() == 0) {
    ASSERT_EQ(chown(map.c_str(), 1234, 4321), 0);
  }
  const mode_t mask = umask(077);
  const bool is_updated = UpdateMap(map, WriteDelta("delta")).ok();
  umask(mask);
  ASSERT_TRUE(is_updated);
  struct stat now = {}, before = {};
  ASSERT_EQ(stat(map.c_str(), &now), 0);
  ASSERT_EQ(stat(PreviousMapPath(map).c_str(), &before), 0);
  EXPECT_EQ(now.st_mode & 0777, 0640U);
  EXPECT_EQ(now.st_uid, before.st_uid);
  EXPECT_EQ(now.st_gid, before.st_gid);
  EXPECT_EQ(before.st_mode & 0777, 0640U);
}

TEST_F(UpdateMapTest, NothingBesideTheMapAndThePreviousOneStays) {
  const fs::path folder = Path("folder");
  fs::remove_all(folder);
  fs::create_directories(folder);
  const std::string map = folder / "robot.cairn", delta = WriteDelta("delta");
  const auto names = [&] {
    std::vector<std::string> found;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder))
      found.push_back(entry.path().filename().string());
    std::sort(found.begin(), found.end());
    return found;
  };
  fs::copy_file(Path("old.cairn"), map);
  ASSERT_TRUE(UpdateMap(map, delta).ok());
  EXPECT_THAT(names(), testing::ElementsAre("robot.cairn", "robot.cairn.previous"));
  // Again, over a previous map.
  ASSERT_TRUE(WriteFileAtomically(map, *ReadFile(Path("old.cairn"))).ok());
  ASSERT_TRUE(WriteFileAtomically(PreviousMapPath(map), "the one before").ok());
  ASSERT_TRUE(UpdateMap(map, delta).ok());
  EXPECT_THAT(names(), testing::ElementsAre("robot.cairn", "robot.cairn.previous"));
  EXPECT_EQ(*ReadFile(PreviousMapPath(map)), *ReadFile(Path("old.cairn")));
  // A folder in its place is not removed, and stops the update before anything is lost.
  ASSERT_TRUE(WriteFileAtomically(map, *ReadFile(Path("old.cairn"))).ok());
  fs::remove(PreviousMapPath(map));
  fs::create_directories(PreviousMapPath(map));
  EXPECT_EQ(UpdateMap(map, delta).error().code, ErrorCode::kIo);
  EXPECT_THAT(names(), testing::ElementsAre("robot.cairn", "robot.cairn.previous"));
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("old.cairn")));
}

// Signed maps of one key: the room in epochs 3 and 4, and another site's in epoch 9.
//   1.cairn  2.cairn  other.cairn
class EpochTest : public UpdateMapTest {
 protected:
  static void SetUpTestSuite() {
    UpdateMapTest::SetUpTestSuite();
    MapRows rows = *ReadMapRows(Path("new.cairn"));
    rows.name = "room";
    ASSERT_TRUE(WriteMapRows(rows, Path("newer.cairn")).ok());
    keys_ = new KeyPair(MakeKeyPair());
    for (const auto& [from, epoch, to] : {std::tuple("old.cairn", 3, "1.cairn"),
                                          {"newer.cairn", 4, "2.cairn"},
                                          {"new.cairn", 9, "other.cairn"}})
      ASSERT_TRUE(SignMap(Path(from), keys_->secret_key, Path(to), epoch).ok());
  }
  static void TearDownTestSuite() { delete keys_; }

  // A signed delta from one map to another, whatever their epochs.
  static std::string Delta(const std::string& from, const std::string& to, const KeyPair& keys = *keys_) {
    const Result<MapDelta> delta = MakeMapDelta(Path(from), Path(to), keys.secret_key, true);
    EXPECT_TRUE(delta.ok()) << delta.error().message;
    EXPECT_TRUE(WriteFileAtomically(Path("epochs.delta"), EncodeMapDelta(*delta)).ok());
    return Path("epochs.delta");
  }

  static ErrorCode CodeOf(const Status& status) { return status.ok() ? ErrorCode{} : status.error().code; }
  static ErrorCode CodeOf(const Result<bool>& result) {
    return result.ok() ? ErrorCode{} : result.error().code;
  }

  static KeyPair* keys_;
};
KeyPair* EpochTest::keys_ = nullptr;

TEST_F(EpochTest, LaterMapOfTheNameTakesItsPlace) {
  const std::string map = Copy("1.cairn", "robot.cairn"), delta = Delta("1.cairn", "2.cairn");
  EXPECT_TRUE(*UpdateMap(map, delta, {.public_key = keys_->public_key, .name = "room", .min_epoch = 4}));
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("2.cairn")));
  // Sent twice, it is still asked for what it is.
  EXPECT_FALSE(*UpdateMap(map, delta, {.public_key = keys_->public_key, .name = "room", .min_epoch = 4}));
  EXPECT_EQ(CodeOf(UpdateMap(map, delta, {.min_epoch = 5})), ErrorCode::kNotNewer);
  EXPECT_EQ(CodeOf(UpdateMap(map, delta, {.name = "hall"})), ErrorCode::kOtherMap);
}

TEST_F(EpochTest, OlderMapIsRefusedUnlessAllowed) {
  const std::string map = Copy("2.cairn", "robot.cairn"), delta = Delta("2.cairn", "1.cairn");
  for (const std::optional<PublicKey>& key : {std::optional(keys_->public_key), std::optional<PublicKey>()}) {
    EXPECT_EQ(CodeOf(UpdateMap(map, delta, {.public_key = key})), ErrorCode::kNotNewer);
    EXPECT_EQ(CodeOf(ApplyDelta(map, delta, Path("made.cairn"), {.public_key = key})), ErrorCode::kNotNewer);
  }
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("2.cairn")));
  EXPECT_FALSE(fs::exists(PreviousMapPath(map)));
  EXPECT_FALSE(fs::exists(Path("made.cairn")));
  EXPECT_EQ(CodeOf(UpdateMap(map, delta, {.allow_older = true, .min_epoch = 4})), ErrorCode::kNotNewer);
  EXPECT_TRUE(ApplyDelta(map, delta, Path("made.cairn"), {.allow_older = true}).ok());
  EXPECT_TRUE(*UpdateMap(map, delta, {.public_key = keys_->public_key, .allow_older = true}));
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("1.cairn")));
}

TEST_F(EpochTest, SameEpochWithOtherContentsIsRefused) {
  ASSERT_TRUE(SignMap(Path("newer.cairn"), keys_->secret_key, Path("fork.cairn"), 3).ok());
  const std::string map = Copy("1.cairn", "robot.cairn");
  EXPECT_EQ(CodeOf(UpdateMap(map, Delta("1.cairn", "fork.cairn"))), ErrorCode::kNotNewer);
}

// "room" to "room, again": whatever the epochs are.
TEST_F(EpochTest, AnotherMapIsNeverTaken) {
  const std::string map = Copy("1.cairn", "robot.cairn"), delta = Delta("1.cairn", "new.cairn");
  for (const bool allow_older : {false, true}) {
    EXPECT_EQ(CodeOf(UpdateMap(map, delta, {.allow_older = allow_older})), ErrorCode::kOtherMap);
    EXPECT_EQ(CodeOf(ApplyDelta(map, delta, Path("made.cairn"), {.allow_older = allow_older})),
              ErrorCode::kOtherMap);
  }
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("1.cairn")));
  EXPECT_FALSE(fs::exists(Path("made.cairn")));
}

TEST_F(EpochTest, DeltaThatRobotsRefuseIsNotMade) {
  const auto code = [](const std::string& from, const std::string& to, bool allow_older) {
    const Result<MapDelta> delta = MakeMapDelta(Path(from), Path(to), std::nullopt, allow_older);
    return delta.ok() ? ErrorCode{} : delta.error().code;
  };
  EXPECT_EQ(code("1.cairn", "2.cairn", false), ErrorCode{});
  EXPECT_EQ(code("2.cairn", "1.cairn", false), ErrorCode::kNotNewer);
  EXPECT_EQ(code("2.cairn", "1.cairn", true), ErrorCode{});
  EXPECT_EQ(code("1.cairn", "1.cairn", false), ErrorCode{});
  EXPECT_EQ(code("1.cairn", "other.cairn", true), ErrorCode::kOtherMap);
  EXPECT_EQ(code("old.cairn", "other.cairn", false), ErrorCode{});  // not signed: nothing counts
  EXPECT_EQ(code("2.cairn", "old.cairn", false), ErrorCode{});
}

// Who requires a key does not count what it has not signed: then the robot's own memory speaks.
TEST_F(EpochTest, MapInPlaceWithoutTheKeyDoesNotCount) {
  const KeyPair others = MakeKeyPair();
  ASSERT_TRUE(SignMap(Path("newer.cairn"), others.secret_key, Path("theirs.cairn"), 100).ok());
  for (const char* in_place : {"newer.cairn", "theirs.cairn"}) {
    const std::string map = Copy(in_place, "robot.cairn"), delta = Delta(in_place, "1.cairn");
    EXPECT_EQ(CodeOf(UpdateMap(map, delta, {.public_key = keys_->public_key, .min_epoch = 4})),
              ErrorCode::kNotNewer);
    EXPECT_EQ(CodeOf(UpdateMap(map, delta, {.public_key = keys_->public_key, .name = "hall"})),
              ErrorCode::kOtherMap);
    EXPECT_TRUE(
        UpdateMap(map, delta, {.public_key = keys_->public_key, .name = "room", .min_epoch = 3}).ok());
  }
  // Without a required key, whoever signed the map in place is followed.
  const std::string map = Copy("theirs.cairn", "robot.cairn");
  EXPECT_EQ(CodeOf(UpdateMap(map, Delta("theirs.cairn", "1.cairn"))), ErrorCode::kNotNewer);
}

// The head of one delta, the payload or the signature of another: all of one key.
TEST_F(EpochTest, DeltasPutTogetherOfOthersAreRefused) {
  ASSERT_TRUE(SignMap(Path("newer.cairn"), keys_->secret_key, Path("3.cairn"), 5).ok());
  const MapDelta to2 = *MakeMapDelta(Path("1.cairn"), Path("2.cairn"), keys_->secret_key);
  const MapDelta to3 = *MakeMapDelta(Path("1.cairn"), Path("3.cairn"), keys_->secret_key);
  const std::string map = Copy("1.cairn", "robot.cairn");
  const auto code = [&](const std::function<void(MapDelta*)>& mix) {
    MapDelta mixed = to2;
    mix(&mixed);
    EXPECT_TRUE(WriteFileAtomically(Path("mixed"), EncodeMapDelta(mixed)).ok());
    return CodeOf(UpdateMap(map, Path("mixed"), {.public_key = keys_->public_key}));
  };
  EXPECT_EQ(code([&](MapDelta* delta) { delta->payload = to3.payload; }), ErrorCode::kWrongKey);
  EXPECT_EQ(code([&](MapDelta* delta) { delta->signature = to3.signature; }), ErrorCode::kWrongKey);
  EXPECT_EQ(code([&](MapDelta* delta) { delta->new_hash = to3.new_hash; }), ErrorCode::kWrongKey);
  EXPECT_EQ(code([&](MapDelta* delta) { delta->map_name = "hall"; }), ErrorCode::kWrongKey);
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("1.cairn")));
  EXPECT_EQ(code([](MapDelta*) {}), ErrorCode{});
}

TEST_F(EpochTest, RollBackGoesBackInTimeButToNoOtherMapOrKey) {
  const std::string map = Copy("1.cairn", "robot.cairn");
  const UpdateOptions required = {.public_key = keys_->public_key};
  ASSERT_TRUE(*UpdateMap(map, Delta("1.cairn", "2.cairn"), required));
  const auto previous_is = [&](const std::string& name) {
    fs::remove(PreviousMapPath(map));
    fs::copy_file(Path(name), PreviousMapPath(map));
  };
  previous_is("other.cairn");
  EXPECT_EQ(CodeOf(RollBackMap(map, required)), ErrorCode::kOtherMap);
  EXPECT_EQ(CodeOf(RollBackMap(map)), ErrorCode::kOtherMap);
  const KeyPair others = MakeKeyPair();
  ASSERT_TRUE(SignMap(Path("old.cairn"), others.secret_key, Path("theirs.cairn"), 3).ok());
  previous_is("theirs.cairn");
  EXPECT_EQ(CodeOf(RollBackMap(map, required)), ErrorCode::kWrongKey);
  previous_is("old.cairn");
  EXPECT_EQ(CodeOf(RollBackMap(map, required)), ErrorCode::kNotSigned);
  fs::remove(PreviousMapPath(map));
  fs::create_symlink(Path("1.cairn"), PreviousMapPath(map));
  EXPECT_EQ(CodeOf(RollBackMap(map, required)), ErrorCode::kIo);
  previous_is("1.cairn");
  EXPECT_EQ(CodeOf(RollBackMap(map, {.public_key = keys_->public_key, .min_epoch = 4})),
            ErrorCode::kNotNewer);
  EXPECT_EQ(CodeOf(RollBackMap(map, {.public_key = keys_->public_key, .name = "hall"})),
            ErrorCode::kOtherMap);
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("2.cairn")));
  EXPECT_EQ(CodeOf(RollBackMap(map, {.public_key = keys_->public_key, .name = "room", .min_epoch = 3})),
            ErrorCode{});
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("1.cairn")));
  EXPECT_EQ(CodeOf(RollBackMap(map, required)), ErrorCode{});  // and forth
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("2.cairn")));
}

TEST_F(EpochTest, DamagedMapIsNoReasonNotToGoBack) {
  const std::string map = Copy("1.cairn", "robot.cairn");
  ASSERT_TRUE(*UpdateMap(map, Delta("1.cairn", "2.cairn")));
  ASSERT_TRUE(WriteFileAtomically(map, "no map any more").ok());
  EXPECT_TRUE(RollBackMap(map, {.public_key = keys_->public_key}).ok());
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("1.cairn")));
}

TEST_F(EpochTest, OpeningAsksForNameAndEpoch) {
  const std::string map = Path("2.cairn");
  const auto code = [&](const MapOptions& options) {
    const auto open = Map::Open(map, options);
    return open.ok() ? ErrorCode{} : open.error().code;
  };
  EXPECT_EQ(code({.name = "room", .min_epoch = 4}), ErrorCode{});
  EXPECT_EQ(code({.public_key = keys_->public_key, .name = "room", .min_epoch = 4}), ErrorCode{});
  EXPECT_EQ(code({.min_epoch = 5}), ErrorCode::kNotNewer);
  EXPECT_EQ(code({.name = "hall"}), ErrorCode::kOtherMap);
  // The signature comes first: what an unsigned map is called says nothing.
  EXPECT_EQ(code({.public_key = MakeKeyPair().public_key, .name = "hall"}), ErrorCode::kWrongKey);
}

TEST_F(UpdateMapTest, DeltaIsNotWrittenOver) {
  const std::string delta = WriteDelta("delta");
  EXPECT_EQ(ApplyDelta(Path("old.cairn"), delta, delta).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(*ReadFile(delta), *ReadFile(WriteDelta("delta")));
}

TEST_F(UpdateMapTest, OldMapIsNotWrittenOver) {
  const std::string map = Copy("old.cairn", "robot.cairn");
  EXPECT_EQ(ApplyDelta(map, WriteDelta("delta"), map).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("old.cairn")));
}

}  // namespace
}  // namespace cairn
