#include "core/delta/map_delta.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/blob.h"
#include "core/base/random.h"
#include "core/delta/prefix_compression.h"
#include "core/delta/row_delta.h"
#include "core/files/file.h"
#include "tests/core/map/full_rows.h"
#include "tests/core/map/packed_rows.h"

namespace cairn {
namespace {

using testing::HasSubstr;

std::string DeltaPath(const std::string& name) { return testing::TempDir() + "/map_delta_" + name; }

MapDelta HandDelta() {
  MapDelta delta;
  for (size_t i = 0; i < 32; ++i) {
    delta.old_hash[i] = static_cast<uint8_t>(i);
    delta.new_hash[i] = static_cast<uint8_t>(100 + i);
  }
  delta.old_num_bytes = 1024;
  delta.new_num_bytes = 8192;
  delta.old_page_size = 512;
  delta.new_page_size = 4096;
  delta.map_name = "kitchen";
  delta.payload = "payload";
  return delta;
}

// The table of map_delta.h, line by line.
TEST(MapDelta, BytesAreThoseThatTheHeaderDraws) {
  const MapDelta delta = HandDelta();
  BlobWriter head;
  head.Bytes(std::string("cairn map delta1"));
  head.Bytes(delta.old_hash.data(), 32);
  head.Bytes(delta.new_hash.data(), 32);
  head.UInt64(1024);
  head.UInt64(8192);
  head.UInt32(512);
  head.UInt32(4096);
  const Hash hash = HashOf(std::string("kitchen\0payload", 15));
  head.Bytes(hash.data(), 32);
  head.Bytes(std::string(32 + 64, '\0'));  // not signed
  head.UInt32(7);
  head.Bytes(std::string("kitchenpayload"));
  const std::string bytes = head.Take();
  EXPECT_EQ(EncodeMapDelta(delta), bytes);
  ASSERT_TRUE(WriteFileAtomically(DeltaPath("hand"), bytes).ok());
  const Result<MapDelta> read = ReadMapDelta(DeltaPath("hand"), std::nullopt);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(EncodeMapDelta(*read), bytes);
  EXPECT_FALSE(read->has_rows);
  EXPECT_FALSE(read->is_signed());
  EXPECT_EQ(read->old_num_bytes, 1024u);
  EXPECT_EQ(read->new_page_size, 4096u);
  EXPECT_EQ(read->map_name, "kitchen");
  EXPECT_EQ(read->payload, "payload");
}

TEST(MapDelta, StatesMapsOfWholePagesUpToAGigabyte) {
  const auto refusal = [](uint64_t num_bytes, uint32_t page_size, bool is_old) {
    MapDelta delta = HandDelta();
    (is_old ? delta.old_num_bytes : delta.new_num_bytes) = num_bytes;
    (is_old ? delta.old_page_size : delta.new_page_size) = page_size;
    EXPECT_TRUE(WriteFileAtomically(DeltaPath("stating"), EncodeMapDelta(delta)).ok());
    const Result<MapDelta> read = ReadMapDelta(DeltaPath("stating"), std::nullopt);
    return read.ok() ? "" : read.error().message;
  };
  for (const bool is_old : {true, false}) {
    EXPECT_EQ(refusal(512, 512, is_old), "");
    EXPECT_EQ(refusal(65536, 65536, is_old), "");
    EXPECT_EQ(refusal(uint64_t{1} << 30, 512, is_old), "");
    EXPECT_THAT(refusal((uint64_t{1} << 30) + 512, 512, is_old),
                HasSubstr("states a map of 1073742336 bytes in pages of 512"));
    EXPECT_THAT(refusal(0, 512, is_old), HasSubstr("states a map of 0 bytes"));
    EXPECT_THAT(refusal(513, 512, is_old), HasSubstr("states a map of 513 bytes"));
    EXPECT_THAT(refusal(131072, 131072, is_old), HasSubstr("in pages of 131072"));
    EXPECT_THAT(refusal(256, 256, is_old), HasSubstr("in pages of 256"));
    EXPECT_THAT(refusal(768, 768, is_old), HasSubstr("in pages of 768"));
  }
}

// Pages without their first four bytes, except the first; then these as numbers less the page's own.  With
// `ends`, 0 less the page's number is exchanged with 2^31.
std::string Unlinked(const std::string& file, size_t page_size, bool ends) {
  std::string contents = file.substr(0, page_size);
  BlobWriter links;
  for (size_t page = 1; page < file.size() / page_size; ++page) {
    const std::string bytes = file.substr(page * page_size, page_size);
    contents += bytes.substr(4);
    int64_t link = 0;
    for (int i = 0; i < 4; ++i) link = 256 * link + static_cast<uint8_t>(bytes[static_cast<size_t>(i)]);
    const int64_t least = -static_cast<int64_t>(page) - 1, end = int64_t{1} << 31;
    link += least;
    if (ends && (link == least || link == end)) link = link == least ? end : least;
    links.UInt32(static_cast<uint32_t>(link));
  }
  return contents + links.Take();
}

TEST(MapDelta, PayloadIsThatOfUnlinkedPages) {
  MapRows rows = FullRows();
  ASSERT_TRUE(WriteMapRows(rows, DeltaPath("old.cairn")).ok());
  rows.landmarks[1].num_observations += 1;
  ASSERT_TRUE(WriteMapRows(rows, DeltaPath("new.cairn")).ok());
  const std::string old_bytes = *ReadFile(DeltaPath("old.cairn")),
                    new_bytes = *ReadFile(DeltaPath("new.cairn"));
  const Result<MapDelta> delta = MakeMapDelta(DeltaPath("old.cairn"), DeltaPath("new.cairn"), std::nullopt);
  ASSERT_TRUE(delta.ok()) << delta.error().message;
  EXPECT_FALSE(delta->has_rows);
  EXPECT_EQ(delta->old_hash, HashOf(old_bytes));
  EXPECT_EQ(delta->new_hash, HashOf(new_bytes));
  EXPECT_EQ(delta->old_num_bytes, old_bytes.size());
  EXPECT_EQ(delta->new_num_bytes, new_bytes.size());
  EXPECT_EQ(delta->old_page_size, 512u);
  const Result<std::string> unlinked =
      DecompressAfter(Unlinked(old_bytes, 512, false), delta->payload, new_bytes.size(), "delta");
  ASSERT_TRUE(unlinked.ok()) << unlinked.error().message;
  EXPECT_EQ(*unlinked, Unlinked(new_bytes, 512, false));
  EXPECT_EQ(*ApplyMapDelta(*delta, old_bytes, DeltaPath("old.cairn"), "delta"), new_bytes);
}

TEST(MapDelta, PayloadWithRowsIsThatOfUnlinkedPagesAfterTheirBlocks) {
  ASSERT_TRUE(WriteMapRows(PackedRows(), DeltaPath("old.cairn")).ok());
  MapRows rows = *ReadMapRows(DeltaPath("old.cairn"));
  const MapRows old_rows = rows;
  rows.landmarks[10].num_observations += 1;
  ASSERT_TRUE(WriteMapRows(rows, DeltaPath("new.cairn")).ok());
  const std::string old_bytes = *ReadFile(DeltaPath("old.cairn")),
                    new_bytes = *ReadFile(DeltaPath("new.cairn"));
  const Result<MapDelta> delta = MakeMapDelta(DeltaPath("old.cairn"), DeltaPath("new.cairn"), std::nullopt);
  ASSERT_TRUE(delta.ok()) << delta.error().message;
  ASSERT_TRUE(delta->has_rows);
  BlobReader reader(delta->payload);
  const std::string row_delta(reader.Bytes(reader.UInt32()));
  const Result<MapRows> made = ApplyRowDelta(old_rows, row_delta, 1 << 26, "delta");
  ASSERT_TRUE(made.ok()) << made.error().message;
  const Result<std::string> unlinked =
      DecompressAfter(Unlinked(old_bytes, 512, true) + EncodedBlocks(*made), reader.Bytes(reader.num_left()),
                      new_bytes.size(), "delta");
  ASSERT_TRUE(unlinked.ok()) << unlinked.error().message;
  EXPECT_EQ(*unlinked, Unlinked(new_bytes, 512, true));
  EXPECT_EQ(*ApplyMapDelta(*delta, old_bytes, DeltaPath("old.cairn"), "delta"), new_bytes);
  EXPECT_THAT(ApplyMapDelta(*delta, old_bytes + 'x', DeltaPath("old.cairn"), "delta").error().message,
              HasSubstr(fmt::format("of {} bytes with the hash ", old_bytes.size() + 1)));
}

// What stands at the very beginning of a long prefix is found there.
TEST(PrefixCompression, FindsWhatThePrefixBeginsWith) {
  Random random(1);
  std::string prefix;
  while (prefix.size() < 5'000'000) prefix += static_cast<char>(random.Bits() >> 32);
  for (const size_t size : {size_t{3'000'000}, prefix.size()}) {
    const std::string_view before = std::string_view(prefix).substr(0, size);
    const std::string bytes = prefix.substr(0, 2000);
    const Result<std::string> frame = CompressAfter(before, bytes, "map");
    ASSERT_TRUE(frame.ok()) << frame.error().message;
    EXPECT_LT(frame->size(), 100u);
    EXPECT_EQ(*DecompressAfter(before, *frame, 2000, "map"), bytes);
    EXPECT_FALSE(DecompressAfter(before, *frame, 1999, "map").ok());
    EXPECT_THAT(DecompressAfter(before, *frame, 2001, "map").error().message,
                HasSubstr("map: its payload has 2000 bytes, but its head states 2001"));
    EXPECT_THAT(DecompressAfter(before, "abc", 2000, "map").error().message,
                HasSubstr("map: its payload cannot be unpacked"));
  }
}

}  // namespace
}  // namespace cairn
