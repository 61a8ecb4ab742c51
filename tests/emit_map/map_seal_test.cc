#include "core/map_seal.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "core/map_file.h"
#include "core/random.h"
#include "stages/emit_map/emit_map.h"
#include "tests/emit_map/example.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string InFolder(const std::string& name) { return testing::TempDir() + "/" + name; }

// A map of the example under this name.
std::string WriteExample(const std::string& name) {
  const EmitExample example = MakeEmitExample();
  MapRows rows = *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                          {.min_num_landmarks_for_words = 0, .landmarks_per_word = 1});
  rows.name = "example";
  rows.writer = "cairn test";
  EXPECT_TRUE(WriteMapRows(rows, InFolder(name)).ok());
  return InFolder(name);
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
    // Whoever does not look at every byte may read it; then it reads what is there.
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

TEST(MapSeal, KeysAreKeptInFilesOfTheirOwn) {
  const std::string path = InFolder("key");
  fs::remove(path);
  fs::remove(path + ".pub");
  const KeyPair keys = MakeKeyPair();
  ASSERT_TRUE(WriteKeyPair(keys, path).ok());
  EXPECT_EQ(*ReadSecretKey(path), keys.secret_key);
  EXPECT_EQ(*ReadPublicKey(path + ".pub"), keys.public_key);
  EXPECT_EQ(fs::status(path).permissions() & (fs::perms::group_all | fs::perms::others_all), fs::perms::none);
  EXPECT_EQ(WriteKeyPair(keys, path).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(ReadPublicKey(path).error().code, ErrorCode::kCorrupt);  // a secret key is no public one
  EXPECT_EQ(ReadSecretKey(InFolder("none")).error().code, ErrorCode::kNotFound);
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
