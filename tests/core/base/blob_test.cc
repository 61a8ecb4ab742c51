#include "core/base/blob.h"

#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

using std::string_literals::operator""s;

std::string VarintOf(uint64_t value) {
  BlobWriter writer;
  writer.Varint(value);
  return writer.Take();
}

TEST(Blob, VarintsHaveSevenBitsAByteTheLowestFirst) {
  EXPECT_EQ(VarintOf(0), "\0"s);
  EXPECT_EQ(VarintOf(0x7f), "\x7f");
  EXPECT_EQ(VarintOf(0x80), "\x80\x01");
  EXPECT_EQ(VarintOf(300), "\xac\x02");
  EXPECT_EQ(VarintOf(uint64_t{1} << 62), "\x80\x80\x80\x80\x80\x80\x80\x80\x40");
  for (int bits = 0; bits < 63; ++bits) {
    for (const uint64_t value : {uint64_t{1} << bits, (uint64_t{2} << bits) - 1}) {
      const std::string bytes = VarintOf(value);
      EXPECT_EQ(std::ssize(bytes), 1 + (value >= 0x80 ? (bits / 7) : 0)) << value;
      BlobReader reader(bytes);
      EXPECT_EQ(reader.Varint(), value);
      EXPECT_TRUE(reader.Finished());
    }
  }
}

TEST(Blob, AVarintOfMoreThanNineBytesOrCutOffIsNone) {
  const std::string nine(8, '\x80');
  for (const std::string& bytes : {nine + "\x80\x01", nine + "\x80", nine, "\x80"s, ""s}) {
    BlobReader reader(bytes);
    EXPECT_EQ(reader.Varint(), 0u);
    EXPECT_FALSE(reader.ok());
    EXPECT_FALSE(reader.Finished());
  }
  const std::string whole = nine + "\x01";
  BlobReader reader(whole);
  EXPECT_EQ(reader.Varint(), uint64_t{1} << 56);
  EXPECT_TRUE(reader.Finished());
}

TEST(Blob, NumbersAreLittleEndian) {
  BlobWriter writer;
  writer.UInt8(0xfe);
  writer.UInt32(0x01020384);
  writer.UInt64(0x0102030405060788);
  writer.Float32(-1.5F);
  writer.Float64(0.1);
  const uint8_t more[] = {7, 8, 9};
  writer.Bytes(more, 2);
  writer.Bytes("xyz");
  EXPECT_EQ(writer.num_bytes(), 30u);
  const std::string bytes = writer.Take();
  EXPECT_EQ(
      bytes,
      "\xfe\x84\x03\x02\x01\x88\x07\x06\x05\x04\x03\x02\x01\0\0\xc0\xbf\x9a\x99\x99\x99\x99\x99\xb9\x3f\x07\x08xyz"s);
  BlobReader reader(bytes);
  EXPECT_EQ(reader.UInt8(), 0xfe);
  EXPECT_EQ(reader.UInt32(), 0x01020384u);
  EXPECT_EQ(reader.UInt64(), 0x0102030405060788u);
  EXPECT_EQ(reader.Float32(), -1.5F);
  EXPECT_EQ(reader.Float64(), 0.1);
  EXPECT_EQ(reader.num_left(), 5u);
  EXPECT_EQ(reader.Bytes(2), "\x07\x08");
  EXPECT_FALSE(reader.Finished());
  EXPECT_EQ(reader.Bytes(3), "xyz");
  EXPECT_TRUE(reader.Finished());
}

TEST(Blob, PastTheEndNothingIsRead) {
  const std::string bytes = "\x01\x02\x03\x04\x05\x06\x07\x08";
  {
    BlobReader reader(bytes);
    EXPECT_EQ(reader.UInt64(), 0x0807060504030201u);  // to the very end
    EXPECT_TRUE(reader.ok());
    EXPECT_EQ(reader.UInt8(), 0);
    EXPECT_FALSE(reader.ok());
  }
  {
    BlobReader reader(bytes);
    EXPECT_EQ(reader.UInt8(), 1);
    EXPECT_EQ(reader.UInt64(), 0u);
    EXPECT_FALSE(reader.ok());
    EXPECT_EQ(reader.UInt8(), 0);  // nor what would be there
    EXPECT_EQ(reader.Bytes(1), "");
    EXPECT_EQ(reader.Varint(), 0u);
    EXPECT_EQ(reader.ZeroTerminated(), "");
  }
  {
    BlobReader reader(bytes);
    EXPECT_EQ(reader.Bytes(8), bytes);
    EXPECT_EQ(reader.Bytes(0), "");
    EXPECT_TRUE(reader.Finished());
    EXPECT_EQ(reader.Bytes(1), "");
    EXPECT_FALSE(reader.ok());
  }
}

TEST(Blob, TextsEndWithAZeroByte) {
  BlobWriter writer;
  writer.ZeroTerminated("wall");
  writer.ZeroTerminated("");
  writer.ZeroTerminated("cut\0off"s);
  const std::string bytes = writer.Take();
  EXPECT_EQ(bytes, "wall\0\0cut\0"s);
  BlobReader reader(bytes);
  EXPECT_EQ(reader.ZeroTerminated(), "wall");
  EXPECT_EQ(reader.ZeroTerminated(), "");
  EXPECT_EQ(reader.ZeroTerminated(), "cut");
  EXPECT_TRUE(reader.Finished());
  BlobReader endless("wall");
  EXPECT_EQ(endless.ZeroTerminated(), "");
  EXPECT_FALSE(endless.ok());
}

TEST(Blob, AscendingNumbersAreStepsFromMinusOne) {
  EXPECT_EQ(EncodeAscending({0, 1, 5}), "\x01\x01\x04");
  EXPECT_EQ(EncodeAscending({}), "");
  const std::vector<int32_t> values = {3, 4, 200, 100000, std::numeric_limits<int32_t>::max()};
  const int64_t limit = int64_t{1} << 31;
  EXPECT_EQ(*DecodeAscending(EncodeAscending(values), 5, limit, "rows"), values);
  EXPECT_TRUE(DecodeAscending("", 0, 0, "rows")->empty());
}

TEST(Blob, WhatIsNotAscendingBelowTheLimitIsCorrupt) {
  const auto error = [](std::string_view bytes, int64_t num, int64_t limit) {
    return DecodeAscending(bytes, num, limit, "rows").error();
  };
  EXPECT_EQ(*DecodeAscending("\x01\x04", 2, 5, "rows"), (std::vector<int32_t>{0, 4}));
  EXPECT_EQ(error("\x01\x04", 2, 4).message, "rows: not ascending numbers below 4");
  EXPECT_EQ(*DecodeAscending("\x05", 1, 5, "rows"), std::vector<int32_t>{4});
  EXPECT_EQ(error("\x06", 1, 5).code, ErrorCode::kCorrupt);
  EXPECT_EQ(error("\x01\0"s, 2, 5).code, ErrorCode::kCorrupt);
  EXPECT_EQ(error(VarintOf(std::numeric_limits<uint64_t>::max() >> 1), 1, 5).code, ErrorCode::kCorrupt);
  EXPECT_EQ(error("\x80", 1, 5).code, ErrorCode::kCorrupt);
  EXPECT_EQ(error("\x01", 2, 5).message, "rows: 2 values in a blob of 1 bytes");
  EXPECT_EQ(error("\x01", -1, 5).message, "rows: -1 values in a blob of 1 bytes");
  EXPECT_EQ(error("\x01\x01", 1, 5).message, "rows: bytes are left after 1 values");
  EXPECT_EQ(error("\x01", 0, 5).message, "rows: bytes are left after 0 values");
}

}  // namespace
}  // namespace cairn
