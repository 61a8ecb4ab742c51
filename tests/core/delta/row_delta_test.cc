#include "core/delta/row_delta.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/delta/map_delta.h"
#include "core/delta/renumbering.h"
#include "core/delta/row_text.h"
#include "core/files/file.h"
#include "tests/core/delta/two_maps.h"
#include "tests/core/map/packed_rows.h"

namespace cairn {
namespace {

using testing::HasSubstr;

constexpr int64_t kMuch = 1 << 24;

// As ReadMapRows gives them: descriptors are what their levels stand for.
MapRows Coded(MapRows rows) {
  rows.descriptor_code = QuantizeByTransform(24, &rows.descriptors);
  return rows;
}

std::string Made(const MapRows& from, const MapRows& to) {
  return MakeRowDelta(from, to, "map").value().value();
}

TEST(RowDelta, LeadsToTheOtherMapsBlocks) {
  const MapRows small = Coded(SmallRows()), changed = Coded(ChangedRows());
  for (const auto& [from, to] :
       {std::pair(small, changed), std::pair(changed, small), std::pair(small, small)}) {
    const Result<MapRows> made = ApplyRowDelta(from, Made(from, to), kMuch, "delta");
    ASSERT_TRUE(made.ok()) << made.error().message;
    EXPECT_EQ(EncodedBlocks(*made), EncodedBlocks(to));
  }
}

TEST(RowDelta, TakesACodeOfItsOwnAlong) {
  const MapRows from = Coded(SmallRows());
  MapRows to = from;
  to.descriptors.setConstant(100);
  to.descriptor_code = QuantizeByTransform(16, &to.descriptors);
  const Result<MapRows> made = ApplyRowDelta(from, Made(from, to), kMuch, "delta");
  ASSERT_TRUE(made.ok()) << made.error().message;
  EXPECT_EQ(made->descriptor_code, to.descriptor_code);
  EXPECT_EQ(EncodedBlocks(*made), EncodedBlocks(to));
}

TEST(RowDelta, IsNoneOfMapsWithoutACode) {
  MapRows plain = SmallRows();
  EXPECT_EQ(MakeRowDelta(plain, Coded(plain), "map").value(), std::nullopt);
  EXPECT_EQ(MakeRowDelta(Coded(plain), plain, "map").value(), std::nullopt);
}

class PackedMaps : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteMapRows(PackedRows(), Path("old")).ok());
    rows_ = *ReadMapRows(Path("old"));
  }
  static std::string Path(const std::string& name) { return testing::TempDir() + "/row_delta_" + name; }

  // Without the landmark, whose successors have other numbers then.
  void Remove(LandmarkIdx landmark) {
    rows_.landmarks.erase(rows_.landmarks.begin() + landmark);
    const Eigen::Index num_after = rows_.descriptors.rows() - landmark - 1;
    rows_.descriptors.middleRows(landmark, num_after) = rows_.descriptors.bottomRows(num_after).eval();
    rows_.descriptors.conservativeResize(rows_.descriptors.rows() - 1, Eigen::NoChange);
    for (MapImage& image : rows_.images) {
      std::erase(image.landmarks, landmark);
      for (LandmarkIdx& other : image.landmarks) other -= other > landmark ? 1 : 0;
    }
  }

  MapDelta Delta() {
    EXPECT_TRUE(WriteMapRows(rows_, Path("new")).ok());
    return MakeMapDelta(Path("old"), Path("new"), std::nullopt).value();
  }

  MapRows rows_;
};

TEST_F(PackedMaps, OneLandmarkLessCostsNextToNothing) {
  Remove(700);
  const MapDelta delta = Delta();
  EXPECT_TRUE(delta.has_rows);
  EXPECT_LT(delta.payload.size(), 800U) << "blocks that follow are all other bytes";
  const std::string old_bytes = *ReadFile(Path("old"));
  EXPECT_EQ(ApplyMapDelta(delta, old_bytes, Path("old"), "delta").value(), *ReadFile(Path("new")));
  // As a file, too.
  ASSERT_TRUE(WriteFileAtomically(Path("delta"), EncodeMapDelta(delta)).ok());
  const Result<MapDelta> read = ReadMapDelta(Path("delta"), std::nullopt);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_TRUE(read->has_rows);
  EXPECT_EQ(EncodeMapDelta(*read), EncodeMapDelta(delta));
}

TEST_F(PackedMaps, TheSameMapNeedsNoRows) {
  const MapDelta delta = Delta();
  EXPECT_FALSE(delta.has_rows);
  EXPECT_LT(delta.payload.size(), 100U);
  const std::string bytes = *ReadFile(Path("old"));
  EXPECT_EQ(ApplyMapDelta(delta, bytes, Path("old"), "delta").value(), bytes);
}

TEST_F(PackedMaps, DeltasOfALaterFormatAreRefused) {
  Remove(3);
  std::string bytes = EncodeMapDelta(Delta());
  EXPECT_EQ(bytes.substr(0, 16), "cairn map delta2");
  bytes[15] = '3';
  ASSERT_TRUE(WriteFileAtomically(Path("later"), bytes).ok());
  const Result<MapDelta> read = ReadMapDelta(Path("later"), std::nullopt);
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(read.error().message, HasSubstr("later format"));
}

// So few bytes must not ask for the memory that rows of a large map take.
TEST_F(PackedMaps, RowsAreOfMapsThatAreSmall) {
  Remove(700);
  const std::string old_bytes = *ReadFile(Path("old"));
  MapDelta delta = Delta();
  ASSERT_TRUE(delta.has_rows);
  delta.new_num_bytes = MapDelta::kMaxRowMapBytes + 1;
  EXPECT_THAT(ApplyMapDelta(delta, old_bytes, Path("old"), "delta").error().message,
              HasSubstr("delta: states rows of a map that is too large for them"));
  delta.new_num_bytes = MapDelta::kMaxRowMapBytes;
  EXPECT_THAT(ApplyMapDelta(delta, old_bytes, Path("old"), "delta").error().message,
              HasSubstr("but its head states"));
}

TEST_F(PackedMaps, RowsOfAnUnsignedDeltaMaySayAnything) {
  Remove(700);
  const MapDelta good = Delta();
  const std::string old_bytes = *ReadFile(Path("old"));
  const auto code = [&](const std::string& payload) {
    MapDelta bad = good;
    bad.payload = payload;
    const Result<std::string> made = ApplyMapDelta(bad, old_bytes, Path("old"), "delta");
    return made.ok() ? ErrorCode{} : made.error().code;
  };
  EXPECT_EQ(code(good.payload), ErrorCode{});
  EXPECT_EQ(code("abc"), ErrorCode::kCorrupt);
  EXPECT_EQ(code(std::string("\xff\xff\xff\x7f", 4) + good.payload.substr(4)), ErrorCode::kCorrupt);
  for (size_t i = 0; i < good.payload.size(); i += 3) {
    std::string payload = good.payload;
    payload[i] = static_cast<char>(payload[i] ^ (1 << i % 8));
    // What a flip in rows changes may lead to the same bytes: a landmark's number that nothing else has, say.
    const ErrorCode found = code(payload);
    EXPECT_TRUE(found == ErrorCode::kCorrupt || found == ErrorCode{}) << i;
  }
}

TEST(RowDelta, RefusesMoreThanItMayTake) {
  const MapRows from = Coded(SmallRows()), to = Coded(ChangedRows());
  const std::string delta = Made(from, to);
  EXPECT_TRUE(ApplyRowDelta(from, delta, 2000, "delta").ok());
  for (const int64_t max_num_bytes : {0, 100, 600}) {
    const Result<MapRows> made = ApplyRowDelta(from, delta, max_num_bytes, "delta");
    ASSERT_FALSE(made.ok()) << max_num_bytes;
    EXPECT_EQ(made.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(made.error().message, HasSubstr("delta"));
  }
  for (size_t length = 0; length < delta.size(); ++length)
    EXPECT_FALSE(ApplyRowDelta(from, delta.substr(0, length), kMuch, "delta").ok()) << length;
}

// A delta that leads to the map itself, up to where its code of descriptors is said.
BlobWriter HeadOf(const MapRows& rows, uint64_t num_regions) {
  BlobWriter writer;
  WriteRenumbering(FindSame(rows, rows), &writer);
  writer.Varint(num_regions);
  return writer;
}

TEST(RowDelta, IsOfSiftDescriptorsAlone) {
  const MapRows rows = Coded(SmallRows());
  MapRows learned = rows;
  learned.descriptor_kind = {DescriptorType::kFloat, kSiftDescriptorDim, ""};
  EXPECT_EQ(MakeRowDelta(learned, learned, "map").value(), std::nullopt);
  EXPECT_EQ(ApplyRowDelta(learned, Made(rows, rows), kMuch, "delta").error().message,
            "delta: its landmarks make no sense");
}

TEST(RowDelta, RefusesMoreRegionsThanItMayTake) {
  const MapRows rows = Coded(SmallRows());
  const auto refused = [&](uint64_t num_regions) {
    return ApplyRowDelta(rows, HeadOf(rows, num_regions).Take(), 100 * sizeof(MapRegion), "delta")
        .error()
        .message;
  };
  EXPECT_EQ(refused(101), "delta: its regions make no sense");
  EXPECT_EQ(refused(100), "delta: its landmarks make no sense") << "which are not there any more";
}

TEST(RowDelta, ACodeIsTheFirstMapsOrItsOwnAndHasAStep) {
  const MapRows rows = Coded(SmallRows());
  const std::string good = Made(rows, rows);
  const size_t place = HeadOf(rows, rows.regions.size()).Take().size();
  ASSERT_EQ(good[place], 0);
  std::string bad = good;
  bad[place] = 2;
  EXPECT_EQ(ApplyRowDelta(rows, bad, kMuch, "delta").error().message, "delta: its landmarks make no sense");
  MapRows plain = rows;
  plain.descriptor_code.reset();
  EXPECT_EQ(ApplyRowDelta(plain, good, kMuch, "delta").error().message, "delta: its landmarks make no sense");
  const auto own_code = [&](uint8_t step) {
    std::string own = good;
    own[place] = 1;
    return own.insert(place + 1, static_cast<char>(step) + std::string(kSiftDescriptorDim, 5));
  };
  EXPECT_TRUE(ApplyRowDelta(rows, own_code(1), kMuch, "delta").ok());
  EXPECT_EQ(ApplyRowDelta(rows, own_code(0), kMuch, "delta").error().message,
            "delta: its landmarks make no sense");
}

// Deltas are read by other versions, too: row_delta.h says how they are laid out.
TEST(RowDelta, HasItsListsIn64sAndThenTheText) {
  const MapRows from = Coded(SmallRows());
  MapRows to = from;
  to.regions.resize(65, to.regions[0]);
  const std::string delta = Made(from, to);
  BlobReader reader(std::string_view(delta).substr(HeadOf(from, 65).Take().size()));
  EXPECT_EQ(reader.UInt8(), 0) << "the first map's code";
  // New landmarks; what images see, in one; landmarks of regions and stations of regions, in two each.
  for (int i = 0; i < 1 + 1 + 2 + 2; ++i) EXPECT_FALSE(reader.Bytes(reader.Varint()).empty()) << i;
  EXPECT_EQ(reader.Varint(), WriteRowText(to).size());
  EXPECT_TRUE(reader.ok());
}

TEST(RowDelta, RefusesMoreInListsThanItMayTake) {
  MapRows from = SmallRows();
  for (int i = 5; i < 60; ++i) {
    from.landmarks.push_back(from.landmarks[0]);
    from.landmarks.back().class_id = 100 + i;
  }
  from.descriptors = DescriptorMatrix::Constant(60, kSiftDescriptorDim, 7);
  from = Coded(from);
  MapRows to = from;
  MapRegion region{.stations = {0, 1, 2}, .landmarks = {}};
  for (int i = 0; i < 60; ++i) region.landmarks.push_back(i);
  to.regions.resize(130, region);
  // Lists as they will be, and how they differ: images 9 and 0, the first two regions 10 and 0, 128 of 63 and
  // as many.
  const int64_t num_bytes = 4 * (9 + 10 + 128 * (63 + 63));
  const std::string delta = Made(from, to);
  const Result<MapRows> made = ApplyRowDelta(from, delta, num_bytes, "delta");
  ASSERT_TRUE(made.ok()) << made.error().message;
  EXPECT_EQ(EncodedBlocks(*made), EncodedBlocks(to));
  EXPECT_EQ(ApplyRowDelta(from, delta, num_bytes - 4, "delta").error().message,
            "delta: its lists make no sense");
}

}  // namespace
}  // namespace cairn
