// Epochs of signed maps: which robots take, and which they go back to.
#include "runtime/map/update_map.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/delta/map_delta.h"
#include "core/files/file.h"
#include "runtime/map/map.h"
#include "tests/runtime/map/update_map_fixture.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

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
  // A delta that is sent twice is still checked against the demands.
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

// A robot that requires a key does not count a map that the key has not signed: the given epoch and
// name count.
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
  // Without a required key, the epoch of the map in place counts, whatever its key.
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
  // The signature is checked first: the name of an unsigned map proves nothing.
  EXPECT_EQ(code({.public_key = MakeKeyPair().public_key, .name = "hall"}), ErrorCode::kWrongKey);
}

}  // namespace
}  // namespace cairn
