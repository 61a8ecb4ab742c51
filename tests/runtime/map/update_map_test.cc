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

#include "core/delta/map_delta.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "runtime/map/map.h"
#include "tests/runtime/map/update_map_fixture.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

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
  // A delta of a later format and a file that is not a delta have different messages.
  const auto reading = [&](const std::string& text) {
    EXPECT_TRUE(WriteFileAtomically(Path("broken"), text).ok());
    return ReadMapDelta(Path("broken"), std::nullopt).error().message;
  };
  std::string later = bytes;
  later[15] = '3';
  EXPECT_THAT(reading(later), HasSubstr("a delta of a later format"));
  // One that says it has rows, and has none.
  std::string with_rows = bytes;
  with_rows[15] = '2';
  EXPECT_TRUE(refused(with_rows));
  std::string other = bytes;
  other[14] = 'A';
  EXPECT_THAT(reading(other), HasSubstr("not a delta of maps"));
  EXPECT_THAT(reading(bytes.substr(0, 15)), HasSubstr("15 bytes, fewer than its head alone has"));
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

// A delta written by hand can have a correct hash of its payload.
TEST_F(UpdateMapTest, HostileDeltasAreRefused) {
  const MapDelta good = *MakeMapDelta(Path("old.cairn"), Path("new.cairn"), std::nullopt);
  using Change = std::function<void(MapDelta*)>;
  const auto write_changed = [&](const Change& change) {
    MapDelta bad = good;
    change(&bad);
    EXPECT_TRUE(WriteFileAtomically(Path("hostile"), EncodeMapDelta(bad)).ok());
  };
  const auto code = [&](const Change& change) {
    write_changed(change);
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
  EXPECT_EQ(code([](MapDelta* delta) { delta->new_page_size = 1024; }), ErrorCode::kCorrupt);
  EXPECT_EQ(code([](MapDelta* delta) { delta->old_page_size = 3; }), ErrorCode::kCorrupt);
  // A state that no map can have is refused as that, before anything is unfolded.
  const auto states = [&](const Change& change) {
    write_changed(change);
    const Result<MapDelta> read = ReadMapDelta(Path("hostile"), std::nullopt);
    return read.ok() ? "read" : read.error().message;
  };
  for (const Change& change :
       std::vector<Change>{[](MapDelta* delta) { delta->old_num_bytes = 0; },
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

TEST_F(UpdateMapTest, WithoutAMapInPlaceThereIsNothingToExchange) {
  const std::string map = Copy("old.cairn", "robot.cairn");
  ASSERT_TRUE(UpdateMap(map, WriteDelta("delta")).ok());
  fs::remove(map);
  const Error error = RollBackMap(map).error();
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_EQ(error.message, map + ": no such file");
  EXPECT_EQ(*ReadFile(PreviousMapPath(map)), *ReadFile(Path("old.cairn")));
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

// Nor is anything else that is no file, when the update stops because of it.
TEST_F(UpdateMapTest, WhatIsInThePlaceOfThePreviousMapStays) {
  const std::string map = Copy("old.cairn", "robot.cairn"), delta = WriteDelta("delta");
  ASSERT_EQ(mkfifo(PreviousMapPath(map).c_str(), 0600), 0);
  EXPECT_EQ(UpdateMap(map, delta).error().code, ErrorCode::kIo);
  EXPECT_TRUE(fs::is_fifo(PreviousMapPath(map)));
  EXPECT_EQ(*ReadFile(map), *ReadFile(Path("old.cairn")));
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
