// Maps that several keys have signed.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/map/map_file.h"
#include "core/seal/map_seal.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A map that Alice has signed, of a ring of three of whom two must sign.
class MapRing : public testing::Test {
 protected:
  MapRing() : folder_(testing::TempDir() + "/map_ring") {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    const Result<MapRows> rows = ReadMapRowsVersion1(GOLDEN_DIR "/map_1.0.cairn");
    EXPECT_TRUE(rows.ok()) << rows.error().message;
    EXPECT_TRUE(WriteMapRows(*rows, Path("unsigned.cairn")).ok());
    map_ = Path("map.cairn");
    EXPECT_TRUE(SignMap(Path("unsigned.cairn"), alice_.secret_key, map_, 4).ok());
    ring_.version = 1;
    ring_.threshold = 2;
    ring_.keys = {{"alice", alice_.public_key}, {"bob", bob_.public_key}, {"carol", carol_.public_key}};
  }
  std::string Path(const std::string& name) const { return folder_ + "/" + name; }

  ErrorCode Open(const std::string& path) {
    const Result<MapFile> map = MapFile::Open(path, {.public_key = ring_});
    message_ = map.ok() ? "" : map.error().message;
    return map.ok() ? ErrorCode{} : map.error().code;
  }

  std::string folder_, map_, message_;
  KeyPair alice_ = MakeKeyPair(), bob_ = MakeKeyPair(), carol_ = MakeKeyPair(), stranger_ = MakeKeyPair();
  KeyRing ring_;
};

TEST_F(MapRing, SecondSignatureLiesBesideAMapThatStaysAsItIs) {
  const std::string bytes = ReadFile(map_).value();
  EXPECT_EQ(Open(map_), ErrorCode::kNotSigned);
  EXPECT_THAT(message_,
              HasSubstr("1 of the 2 signatures that ring 1 (alice, bob, carol) requires: by alice"));
  ASSERT_TRUE(AddMapSignature(map_, bob_.secret_key, SignaturesPath(map_)).ok());
  EXPECT_EQ(Open(map_), ErrorCode{});
  EXPECT_EQ(ReadFile(map_).value(), bytes);
  // A robot of one key opens it as ever, whatever lies beside it.
  EXPECT_TRUE(MapFile::Open(map_, {.public_key = alice_.public_key}).ok());
  EXPECT_TRUE(MapFile::Open(map_, {.public_key = bob_.public_key}).ok());
  EXPECT_EQ(MapFile::Open(map_, {.public_key = carol_.public_key}).error().code, ErrorCode::kWrongKey);
  EXPECT_TRUE(MapFile::Open(map_, {}).ok());
}

TEST_F(MapRing, FilesOfSeveralMachinesAreJoined) {
  ASSERT_TRUE(AddMapSignature(map_, bob_.secret_key, Path("bobs")).ok());
  ASSERT_TRUE(AddMapSignature(map_, carol_.secret_key, Path("carols")).ok());
  ring_.threshold = 3;
  const std::string bobs = ReadFile(Path("bobs")).value(), carols = ReadFile(Path("carols")).value();
  for (const std::string& joined : {bobs + carols, carols + bobs, bobs + carols + bobs}) {
    ASSERT_TRUE(WriteFileAtomically(SignaturesPath(map_), joined).ok());
    EXPECT_EQ(Open(map_), ErrorCode{});
  }
  ASSERT_TRUE(WriteFileAtomically(SignaturesPath(map_), bobs + bobs).ok());
  EXPECT_EQ(Open(map_), ErrorCode::kNotSigned);
  EXPECT_THAT(message_, HasSubstr("2 of the 3 signatures"));
}

// A signature is of one release of one map.
TEST_F(MapRing, SignaturesOfAnotherMapDoNotCount) {
  ASSERT_TRUE(SignMap(Path("unsigned.cairn"), alice_.secret_key, Path("older.cairn"), 3).ok());
  ASSERT_TRUE(
      AddMapSignature(Path("older.cairn"), bob_.secret_key, SignaturesPath(Path("older.cairn"))).ok());
  EXPECT_EQ(Open(Path("older.cairn")), ErrorCode{});
  fs::copy_file(SignaturesPath(Path("older.cairn")), SignaturesPath(map_));
  EXPECT_EQ(Open(map_), ErrorCode::kNotSigned);
}

TEST_F(MapRing, StrangersSignaturesDoNotCount) {
  ASSERT_TRUE(AddMapSignature(map_, stranger_.secret_key, SignaturesPath(map_)).ok());
  EXPECT_EQ(Open(map_), ErrorCode::kNotSigned);
  // A stranger's in the seal counts as none, and two of the ring's beside it as two.
  ASSERT_TRUE(SignMap(Path("unsigned.cairn"), stranger_.secret_key, Path("theirs.cairn"), 4).ok());
  EXPECT_EQ(Open(Path("theirs.cairn")), ErrorCode::kWrongKey);
  ASSERT_TRUE(
      AddMapSignature(Path("theirs.cairn"), bob_.secret_key, SignaturesPath(Path("theirs.cairn"))).ok());
  EXPECT_EQ(Open(Path("theirs.cairn")), ErrorCode::kNotSigned);
  ASSERT_TRUE(
      AddMapSignature(Path("theirs.cairn"), carol_.secret_key, SignaturesPath(Path("theirs.cairn"))).ok());
  EXPECT_EQ(Open(Path("theirs.cairn")), ErrorCode{});
}

// Whoever signs, the signed bytes are the same: a map that is signed anew keeps what lies beside it.
TEST_F(MapRing, SignedBytesHaveNoKey) {
  ASSERT_TRUE(AddMapSignature(map_, bob_.secret_key, SignaturesPath(map_)).ok());
  ASSERT_TRUE(SignMap(map_, carol_.secret_key, map_).ok());
  EXPECT_EQ(Open(map_), ErrorCode{});
  ring_.threshold = 3;
  EXPECT_EQ(Open(map_), ErrorCode::kNotSigned);  // Alice's was in the seal
}

TEST_F(MapRing, ForgedMapHasNoSignatures) {
  ASSERT_TRUE(AddMapSignature(map_, bob_.secret_key, SignaturesPath(map_)).ok());
  const std::string bytes = ReadFile(map_).value();
  const size_t seal = bytes.find("cairn map seal 2");
  for (const size_t offset : {20, 50, 90, 120}) {  // root, file, key, signature
    std::string forged = bytes;
    forged[seal + offset] ^= 1;
    ASSERT_TRUE(WriteFileAtomically(map_, forged).ok());
    EXPECT_EQ(Open(map_), ErrorCode::kWrongKey) << offset;
  }
}

TEST_F(MapRing, WhatIsNotWholeOrNotSignedGetsNoSignature) {
  const std::string path = SignaturesPath(map_);
  EXPECT_EQ(AddMapSignature(Path("unsigned.cairn"), bob_.secret_key, path).error().code,
            ErrorCode::kNotSigned);
  const Status twice = AddMapSignature(map_, alice_.secret_key, path);
  EXPECT_EQ(twice.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(twice.error().message, HasSubstr("in its seal already"));
  SecretKey damaged = bob_.secret_key;
  damaged[5] ^= 1;
  EXPECT_EQ(AddMapSignature(map_, damaged, path).error().code, ErrorCode::kCorrupt);
  std::string bytes = ReadFile(map_).value();
  bytes.back() ^= 1;
  ASSERT_TRUE(WriteFileAtomically(map_, bytes).ok());
  EXPECT_EQ(AddMapSignature(map_, bob_.secret_key, path).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(AddMapSignature(Path("none"), bob_.secret_key, path).error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(fs::exists(path));
}

TEST_F(MapRing, LinkToAMapHasTheSignaturesBesideTheMap) {
  ASSERT_TRUE(AddMapSignature(map_, bob_.secret_key, SignaturesPath(map_)).ok());
  fs::create_directories(Path("elsewhere"));
  fs::create_symlink(map_, Path("elsewhere/link.cairn"));
  EXPECT_EQ(Open(Path("elsewhere/link.cairn")), ErrorCode{});
}

TEST_F(MapRing, GivenSignaturesTakeThePlaceOfThoseBesideTheMap) {
  ASSERT_TRUE(AddMapSignature(map_, bob_.secret_key, Path("bobs")).ok());
  const SignatureList bobs = ReadSignatures(Path("bobs")).value();
  EXPECT_TRUE(MapFile::Open(map_, {.public_key = ring_, .signatures = bobs}).ok());
  fs::rename(Path("bobs"), SignaturesPath(map_));
  EXPECT_FALSE(MapFile::Open(map_, {.public_key = ring_, .signatures = SignatureList()}).ok());
}

}  // namespace
}  // namespace cairn
