#include "core/atlas/atlas_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/seal/map_seal.h"
#include "tests/core/atlas/two_floors.h"

namespace cairn {
namespace {

using testing::HasSubstr;

std::string Path(const std::string& name) { return testing::TempDir() + "/atlas_" + name; }

std::string Write(const std::string& name, const std::string& bytes) {
  std::ofstream(Path(name), std::ios::binary) << bytes;  // not synced: there are thousands
  return Path(name);
}

std::string Bytes(AtlasRows atlas, const std::optional<SecretKey>& key = std::nullopt) {
  const Result<std::string> bytes = EncodeAtlas(key, &atlas);
  EXPECT_TRUE(bytes.ok()) << bytes.error().message;
  return *bytes;
}

TEST(AtlasFile, ReadsWhatWasWritten) {
  const AtlasRows written = TwoFloors();
  const Result<AtlasRows> read = ReadAtlas(Write("whole", Bytes(written)), std::nullopt);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->name, "campus");
  EXPECT_EQ(read->epoch, 7u);
  EXPECT_FALSE(read->is_signed());
  EXPECT_EQ(read->code_book, written.code_book);
  ASSERT_EQ(read->maps.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read->maps[i].name, written.maps[i].name);
    EXPECT_EQ(read->maps[i].file, written.maps[i].file);
    EXPECT_EQ(read->maps[i].fingerprint, written.maps[i].fingerprint);
    EXPECT_EQ(read->maps[i].num_bytes, written.maps[i].num_bytes);
    EXPECT_EQ(read->maps[i].num_images, written.maps[i].num_images);
    EXPECT_EQ(read->maps[i].places, written.maps[i].places);
  }
  ASSERT_EQ(read->look_alikes.size(), 1u);
  EXPECT_EQ(read->look_alikes[0].image, (AtlasImage{0, 39}));
  EXPECT_EQ(read->look_alikes[0].other, (AtlasImage{1, 8}));
  ASSERT_EQ(read->passages.size(), 1u);
  EXPECT_EQ(read->passages[0].name, "lift");
  EXPECT_EQ(read->passages[0].from, (AtlasImage{0, 3}));
  EXPECT_EQ(read->passages[0].to, (AtlasImage{1, 0}));
  EXPECT_EQ(read->passages[0].cost, 12.5);
  EXPECT_EQ(Bytes(*read), Bytes(written));
}

TEST(AtlasFile, ManyCodesTakeFewBytes) {
  Random random(1);
  std::vector<uint32_t> codes;
  for (int i = 0; i < 200; ++i)
    codes.push_back(static_cast<uint32_t>(random.UniformInt(0, (int64_t{1} << 32) - 1)));
  std::sort(codes.begin(), codes.end());
  // log2(2^32 / 200) + 1.44 bits each are the least that is possible for random numbers.
  const double least = 200 * (std::log2(std::pow(2.0, 32) / 200) + 1.44) / 8;
  EXPECT_LT(static_cast<double>(NumBytesOfPlaces({codes})), 1.06 * least);
  EXPECT_GT(static_cast<double>(NumBytesOfPlaces({codes})), least - 8);
}

TEST(AtlasFile, IsReadWithTheKeyThatSignedIt) {
  const KeyPair keys = MakeKeyPair(), others = MakeKeyPair();
  const std::string path = Write("signed", Bytes(TwoFloors(), keys.secret_key));
  const Result<AtlasRows> read = ReadAtlas(path, keys.public_key);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_TRUE(read->is_signed());
  EXPECT_EQ(read->public_key, keys.public_key);
  EXPECT_EQ(ReadAtlas(path, others.public_key).error().code, ErrorCode::kWrongKey);
  EXPECT_EQ(ReadAtlas(Write("plain", Bytes(TwoFloors())), keys.public_key).error().code,
            ErrorCode::kNotSigned);
}

TEST(AtlasFile, EveryChangedByteIsNoticed) {
  const KeyPair keys = MakeKeyPair();
  const std::string bytes = Bytes(TwoFloors(), keys.secret_key);
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::string changed = bytes;
    changed[i] = static_cast<char>(changed[i] ^ 0x10);
    EXPECT_FALSE(ReadAtlas(Write("changed", changed), std::nullopt).ok()) << i;
  }
}

TEST(AtlasFile, EveryShorterFileIsRefused) {
  const std::string bytes = Bytes(TwoFloors());
  for (size_t size = 0; size < bytes.size(); ++size) {
    const Result<AtlasRows> read = ReadAtlas(Write("short", bytes.substr(0, size)), std::nullopt);
    ASSERT_FALSE(read.ok()) << size;
    const ErrorCode expected = size == 0    ? ErrorCode::kEmptyFile
                               : size < 144 ? ErrorCode::kTruncated  // head and signature
                                            : ErrorCode::kCorrupt;
    EXPECT_EQ(read.error().code, expected) << size;
  }
}

TEST(AtlasFile, OtherFilesAreNotOne) {
  EXPECT_EQ(ReadAtlas(Path("none"), std::nullopt).error().code, ErrorCode::kNotFound);
  const Result<AtlasRows> text = ReadAtlas(Write("text", "cairn, a heap of stones"), std::nullopt);
  EXPECT_EQ(text.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(text.error().message, HasSubstr("cairn atlas MAP"));
  std::string later = Bytes(TwoFloors());
  later[15] = '2';
  EXPECT_THAT(ReadAtlas(Write("later", later), std::nullopt).error().message, HasSubstr("later format"));
  EXPECT_TRUE(IsAtlasFile(Write("whole", Bytes(TwoFloors()))));
  EXPECT_FALSE(IsAtlasFile(Path("text")));
  EXPECT_FALSE(IsAtlasFile(Path("none")));
}

// What is wrong with an atlas, in words.
std::string Fault(AtlasRows atlas) {
  const Result<std::string> bytes = EncodeAtlas(std::nullopt, &atlas);
  if (bytes.ok()) return "";
  EXPECT_EQ(bytes.error().code, ErrorCode::kInvalidArgument);
  return bytes.error().message;
}

TEST(AtlasFile, WhatMakesNoSenseIsNotWritten) {
  const AtlasRows good = TwoFloors();
  EXPECT_EQ(Fault(good), "");
  EXPECT_THAT(Fault(AtlasRows()), HasSubstr("without maps"));
  AtlasRows bad = good;
  bad.maps[1].name = "floor 1";
  EXPECT_THAT(Fault(bad), HasSubstr("called 'floor 1'"));
  bad = good;
  bad.maps[0].places[0] = {3, 3};
  EXPECT_THAT(Fault(bad), HasSubstr("ascend"));
  bad = good;
  bad.look_alikes[0].image.image = 40;
  EXPECT_THAT(Fault(bad), HasSubstr("image 40 of 40"));
  bad = good;
  bad.look_alikes[0].other.map = 2;
  EXPECT_THAT(Fault(bad), HasSubstr("map 2 of 2"));
  for (const AtlasImage& image : {AtlasImage{-1, 0}, AtlasImage{0, -1}}) {
    bad = good;
    bad.passages[0].from = image;
    EXPECT_THAT(Fault(bad), HasSubstr("a passage"));
    bad = good;
    bad.passages[0].to = image;
    EXPECT_THAT(Fault(bad), HasSubstr("a passage"));
  }
  for (const double cost :
       {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    bad = good;
    bad.passages[0].cost = cost;
    EXPECT_THAT(Fault(bad), HasSubstr("'lift': a cost"));
  }
}

// An atlas as anyone can seal it without a key: the hash is right, the contents are not.
std::string Resealed(const std::string& payload) {
  std::string bytes = Bytes(TwoFloors()).substr(0, 16);
  const Hash hash = HashOf(payload);
  bytes.append(hash.begin(), hash.end());
  return bytes + std::string(96, '\0') + payload;
}

TEST(AtlasFile, AnyContentsWithARightHashAreReadOrRefused) {
  const std::string payload = Bytes(TwoFloors()).substr(144);
  ASSERT_TRUE(ReadAtlas(Write("resealed", Resealed(payload)), std::nullopt).ok());
  Random random(5);
  int num_read = 0;
  for (int i = 0; i < 1000; ++i) {
    std::string changed = payload;
    for (int64_t k = random.UniformInt(1, 4); k > 0; --k)
      changed[random.UniformInt(0, static_cast<int64_t>(changed.size()) - 1)] =
          static_cast<char>(random.UniformInt(0, 255));
    if (random.UniformInt(0, 3) == 0)
      changed.resize(random.UniformInt(0, static_cast<int64_t>(changed.size())));
    const Result<AtlasRows> read = ReadAtlas(Write("lying", Resealed(changed)), std::nullopt);
    if (read.ok()) {
      ++num_read;
      EXPECT_EQ(Fault(*read), "");
    } else {
      EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
    }
  }
  EXPECT_GT(num_read, 0);  // names and fingerprints may be any
}

}  // namespace
}  // namespace cairn
