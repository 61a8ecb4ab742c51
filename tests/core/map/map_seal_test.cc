#include "core/seal/map_seal.h"

#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/delta/map_delta.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/map/map_epoch.h"
#include "core/map/map_file.h"
#include "core/map/map_tables.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string InFolder(const std::string& name) { return testing::TempDir() + "/" + name; }

// A map of the example under this name.
std::string WriteExample(const std::string& name) {
  const EmitExample example = MakeEmitExample();
  MapRows rows =
      *emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                         {.landmarks = "regions", .min_num_landmarks_for_words = 0, .landmarks_per_word = 1});
  rows.name = "example";
  rows.writer = "cairn test";
  EXPECT_TRUE(WriteMapRows(rows, InFolder(name)).ok());
  return InFolder(name);
}

// Changes a map's tables, and seals the changed map.
void Reseal(const std::string& path, const std::string& sql) {
  Hash root = {};
  {
    SQLite::Database database(path, SQLite::OPEN_READWRITE);
    database.exec("PRAGMA journal_mode = OFF");
    database.exec(sql);
    const StoredRows rows = *ReadStoredRows(database, path, HeadTables(), int64_t{1} << 40);
    SQLite::Statement directory(database, "SELECT entries FROM directory");
    ASSERT_TRUE(directory.executeStep());
    root = RootHash(rows, directory.getColumn(0).getString());
  }
  ASSERT_TRUE(SealFile(path, root).ok());
}

Status Verify(const std::string& path, const std::optional<PublicKey>& key = std::nullopt) {
  CAIRN_RETURN_IF_ERROR(MapFile::Open(path, {.public_key = key}));
  return CheckFileHash(path);
}

TEST(MapSeal, WholeMapIsVerified) {
  const std::string path = WriteExample("whole.cairn");
  EXPECT_TRUE(Verify(path).ok());
  EXPECT_FALSE(ReadSeal(path)->is_signed());
}

TEST(MapSeal, StandsWholeAndOnceInTheSecondPage) {
  const std::string path = WriteExample("seal_place.cairn");
  const std::string bytes = *ReadFile(path), magic = "cairn map seal 2";
  // [SQLite file format, 1.3.2]: the page's size is at 16, big-endian.
  const size_t page_size = 256 * static_cast<uint8_t>(bytes[16]) + static_cast<uint8_t>(bytes[17]);
  const size_t seal = bytes.find(magic);
  ASSERT_EQ(seal + Seal::kNumBytes, 2 * page_size);  // a row stands at the end of its page
  const auto error_with = [&](size_t place, bool has_other) {
    std::string changed = bytes;
    if (!has_other) changed.replace(seal, magic.size(), magic.size(), '-');
    changed.replace(place, magic.size(), magic);
    EXPECT_TRUE(WriteFileAtomically(path, changed).ok());
    const Result<Seal> read = ReadSeal(path);
    return read.ok() ? std::string() : read.error().message;
  };
  EXPECT_EQ(error_with(seal - 1, false), "");  // whole, if of other values
  for (const size_t place : {seal + 1, 2 * page_size - magic.size(), 2 * page_size, page_size - magic.size()})
    EXPECT_THAT(error_with(place, false), HasSubstr("page 2 has no seal")) << place;
  EXPECT_THAT(error_with(seal - magic.size(), true), HasSubstr("page 2 has no seal"));
}

TEST(MapSeal, EverySingleFlippedBitIsFound) {
  const std::string path = WriteExample("flip.cairn");
  const std::string bytes = *ReadFile(path);
  // Every bit of the header and the seal's page, and some of all the others.
  std::vector<size_t> bits;
  for (size_t bit = 0; bit < 8 * 100; ++bit) bits.push_back(bit);
  const size_t seal = bytes.find("cairn map seal 2");
  for (size_t bit = 8 * seal; bit < 8 * (seal + Seal::kNumBytes); ++bit) bits.push_back(bit);
  Random random(1);
  for (int i = 0; i < 1500; ++i) bits.push_back(random.UniformInt(0, 8 * bytes.size() - 1));
  for (const size_t bit : bits) {
    std::string flipped = bytes;
    flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ 1 << bit % 8);
    // Not WriteFileAtomically: thousands of syncs take minutes.
    std::FILE* const file = std::fopen(InFolder("flipped.cairn").c_str(), "wb");
    std::fwrite(flipped.data(), 1, flipped.size(), file);
    std::fclose(file);
    EXPECT_FALSE(Verify(InFolder("flipped.cairn")).ok()) << "bit " << bit;
    // A reader that does not check every byte may open it; then it reads the bytes that are there.
    const Result<MapRows> rows = ReadMapRows(InFolder("flipped.cairn"));
    EXPECT_TRUE(!rows.ok() || rows->name == "example");
  }
}

TEST(MapSeal, SignatureIsThatOfItsKey) {
  const std::string path = WriteExample("unsigned.cairn");
  const KeyPair keys = MakeKeyPair(), others = MakeKeyPair();
  const std::string signed_path = InFolder("signed.cairn");
  const std::string before = *ReadFile(path);
  ASSERT_TRUE(SignMap(path, keys.secret_key, signed_path).ok());
  EXPECT_EQ(*ReadFile(path), before);
  EXPECT_TRUE(Verify(signed_path).ok());
  EXPECT_TRUE(Verify(signed_path, keys.public_key).ok());
  EXPECT_EQ(Verify(signed_path, others.public_key).error().code, ErrorCode::kWrongKey);
  EXPECT_EQ(Verify(path, keys.public_key).error().code, ErrorCode::kNotSigned);
  // The same map and key: the same bytes.
  ASSERT_TRUE(SignMap(path, keys.secret_key, InFolder("again.cairn")).ok());
  EXPECT_EQ(*ReadFile(InFolder("again.cairn")), *ReadFile(signed_path));
  // Signed by another one since.
  ASSERT_TRUE(SignMap(signed_path, others.secret_key, signed_path).ok());
  EXPECT_TRUE(Verify(signed_path, others.public_key).ok());
}

TEST(MapSeal, ForgedRootIsNotSigned) {
  const std::string path = WriteExample("forged.cairn");
  const KeyPair keys = MakeKeyPair();
  ASSERT_TRUE(SignMap(path, keys.secret_key, path).ok());
  std::string bytes = *ReadFile(path);
  bytes[bytes.find("cairn map seal 2") + 20] ^= 1;
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  EXPECT_EQ(MapFile::Open(path, {}).error().code, ErrorCode::kWrongKey);
}

TEST(MapSeal, DamagedMapIsNotSigned) {
  const std::string path = WriteExample("damaged.cairn");
  std::string bytes = *ReadFile(path);
  bytes.back() ^= 1;
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  EXPECT_EQ(SignMap(path, MakeKeyPair().secret_key, InFolder("no.cairn")).error().code, ErrorCode::kCorrupt);
  EXPECT_FALSE(fs::exists(InFolder("no.cairn")));
}

TEST(MapSeal, DamagedKeySignsNoMap) {
  const std::string path = WriteExample("to_sign.cairn"), signed_path = InFolder("by_damaged.cairn");
  const KeyPair keys = MakeKeyPair();
  for (const size_t byte : {size_t{0}, size_t{31}, size_t{32}, size_t{63}}) {
    SecretKey damaged = keys.secret_key;
    damaged[byte] ^= 0x10;
    EXPECT_EQ(SignMap(path, damaged, signed_path).error().code, ErrorCode::kCorrupt) << byte;
    EXPECT_EQ(MakeMapDelta(path, path, damaged).error().code, ErrorCode::kCorrupt) << byte;
    EXPECT_FALSE(fs::exists(signed_path));
  }
}

TEST(MapSeal, EpochIsSignedAndNothingElseChanges) {
  const std::string path = WriteExample("uncounted.cairn");
  const KeyPair keys = MakeKeyPair();
  const auto epoch_of = [&](const std::string& map) {
    EXPECT_TRUE(Verify(map, keys.public_key).ok());
    return ReadMapRows(map)->epoch;
  };
  EXPECT_EQ(ReadMapRows(path)->epoch, 0U);
  const std::string first = InFolder("first.cairn"), later = InFolder("later.cairn");
  EXPECT_EQ(*SignMap(path, keys.secret_key, first), 1U);
  EXPECT_EQ(epoch_of(first), 1U);
  EXPECT_EQ(*SignMap(path, keys.secret_key, later, 41), 41U);
  EXPECT_EQ(epoch_of(later), 41U);
  // A map with an epoch keeps it, and so its bytes, unless another epoch is given.
  EXPECT_EQ(*SignMap(later, keys.secret_key, InFolder("again.cairn")), 41U);
  EXPECT_EQ(*ReadFile(InFolder("again.cairn")), *ReadFile(later));
  EXPECT_EQ(*SignMap(later, keys.secret_key, InFolder("next.cairn"), 42), 42U);
  EXPECT_EQ(epoch_of(InFolder("next.cairn")), 42U);
  EXPECT_EQ(*SignMap(path, keys.secret_key, InFolder("same.cairn"), 41), 41U);
  EXPECT_EQ(*ReadFile(InFolder("same.cairn")), *ReadFile(later));
  EXPECT_EQ(SignMap(path, keys.secret_key, InFolder("zero.cairn"), 0).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_FALSE(fs::exists(InFolder("zero.cairn")));
  // All else is as it was: with the epoch taken out, the rows make the same file.
  MapRows rows = *ReadMapRows(later);
  rows.epoch = 0;
  ASSERT_TRUE(WriteMapRows(rows, InFolder("back.cairn")).ok());
  EXPECT_EQ(*ReadFile(InFolder("back.cairn")), *ReadFile(path));
}

TEST(MapSeal, NextEpochFollowsASignedMapOfThatNameAndKey) {
  const std::string path = WriteExample("base.cairn");
  const KeyPair keys = MakeKeyPair(), others = MakeKeyPair();
  const std::string counted = InFolder("counted.cairn"), last = InFolder("last.cairn");
  ASSERT_TRUE(SignMap(path, keys.secret_key, counted, 6).ok());
  EXPECT_EQ(*EpochAfter(counted, "example", keys.public_key), 7U);
  EXPECT_EQ(EpochAfter(counted, "other", keys.public_key).error().code, ErrorCode::kOtherMap);
  EXPECT_EQ(EpochAfter(counted, "example", others.public_key).error().code, ErrorCode::kWrongKey);
  EXPECT_EQ(EpochAfter(path, "example", keys.public_key).error().code, ErrorCode::kNotSigned);
  EXPECT_EQ(EpochAfter(InFolder("no such"), "example", keys.public_key).error().code, ErrorCode::kNotFound);
  constexpr uint64_t kLast = std::numeric_limits<uint64_t>::max();
  ASSERT_EQ(*SignMap(path, keys.secret_key, last, kLast - 1), kLast - 1);
  EXPECT_EQ(*EpochAfter(last, "example", keys.public_key), kLast);
  ASSERT_EQ(*SignMap(path, keys.secret_key, last, kLast), kLast);
  EXPECT_TRUE(Verify(last, keys.public_key).ok());
  EXPECT_EQ(EpochAfter(last, "example", keys.public_key).error().code, ErrorCode::kInvalidArgument);
}

// The conditions for a later map to follow, and the required epoch.
TEST(MapSeal, OnlyALaterEpochOfTheSameNameFollows) {
  MapHead old;
  old.name = "kitchen";
  old.epoch = 5;
  const auto code = [&](const std::string& name, uint64_t epoch, bool allow_older) {
    MapHead next;
    next.name = name;
    next.epoch = epoch;
    const Status status = CheckFollows(next, "next", old, "old", allow_older);
    return status.ok() ? ErrorCode{} : status.error().code;
  };
  EXPECT_EQ(code("kitchen", 6, false), ErrorCode{});
  EXPECT_EQ(code("kitchen", 5, false), ErrorCode::kNotNewer);
  EXPECT_EQ(code("kitchen", 4, false), ErrorCode::kNotNewer);
  EXPECT_EQ(code("kitchen", 0, false), ErrorCode::kNotNewer);
  EXPECT_EQ(code("kitchen", 4, true), ErrorCode{});
  EXPECT_EQ(code("cellar", 6, false), ErrorCode::kOtherMap);
  EXPECT_EQ(code("cellar", 6, true), ErrorCode::kOtherMap);
  EXPECT_TRUE(CheckAskedFor(old, "old", "", 0).ok());
  EXPECT_TRUE(CheckAskedFor(old, "old", "kitchen", 5).ok());
  EXPECT_EQ(CheckAskedFor(old, "old", "kitchen", 6).error().code, ErrorCode::kNotNewer);
  EXPECT_EQ(CheckAskedFor(old, "old", "cellar", 5).error().code, ErrorCode::kOtherMap);
}

// An epoch that is no number of 64 bits, in a map that is otherwise right.
TEST(MapSeal, EpochThatIsNoNumberIsRefused) {
  for (const char* epoch : {"-1", "18446744073709551616", "three", "", "1 "}) {
    const std::string path = WriteExample("odd.cairn");
    Reseal(path, fmt::format("INSERT INTO meta VALUES ('epoch', '{}')", epoch));
    EXPECT_EQ(MapFile::Open(path, {}).error().code, ErrorCode::kCorrupt) << "'" << epoch << "'";
  }
}

// Signing a map of unknown origin signs its contents and runs nothing in it.
TEST(MapSeal, NothingInAMapRunsWhileItIsSigned) {
  const KeyPair keys = MakeKeyPair();
  const std::string path = WriteExample("trigger.cairn");
  Reseal(path,
         "CREATE TRIGGER t AFTER INSERT ON meta BEGIN UPDATE meta SET value = 'theirs' WHERE key = "
         "'name'; END");
  ASSERT_TRUE(SignMap(path, keys.secret_key, InFolder("of_trigger.cairn")).ok());
  EXPECT_EQ(ReadMapRows(InFolder("of_trigger.cairn"))->name, "example");
  // The epoch would take the place of another row.
  const std::string unique = WriteExample("unique.cairn");
  Reseal(unique,
         "UPDATE meta SET value = '77' WHERE key = 'writer'; CREATE UNIQUE INDEX u ON meta (value) "
         "WHERE value = '77'");
  EXPECT_EQ(SignMap(unique, keys.secret_key, InFolder("of_unique.cairn"), 77).error().code,
            ErrorCode::kCorrupt);
  EXPECT_FALSE(fs::exists(InFolder("of_unique.cairn")));
}

TEST(MapSeal, BlockIsCheckedWhenItIsRead) {
  const std::string path = WriteExample("block.cairn");
  const MapFile whole = *MapFile::Open(path, {});
  const int64_t block = whole.directory().Block(BlockKind::kLandmarks, 0);
  const std::string landmarks = *whole.ReadBlock(block);
  std::string bytes = *ReadFile(path);
  const size_t place = bytes.find(landmarks.substr(0, 32));
  ASSERT_NE(place, std::string::npos);
  bytes[place + 5] ^= 1;
  ASSERT_TRUE(WriteFileAtomically(InFolder("hurt.cairn"), bytes).ok());
  const Result<MapFile> hurt = MapFile::Open(InFolder("hurt.cairn"), {});  // which does not look at blocks
  ASSERT_TRUE(hurt.ok()) << hurt.error().message;
  EXPECT_EQ(hurt->ReadBlock(block).error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(hurt->ReadBlock(block).error().message, HasSubstr("copy it again"));
  EXPECT_TRUE(hurt->ReadBlock(0).ok());
}

}  // namespace
}  // namespace cairn
