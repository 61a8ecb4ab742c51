// Bags: what is read of their files, whole, damaged and hostile.
#include "pipeline/exchange/bags/files/bag.h"

#include <filesystem>
#include <fstream>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/bag_file.h"
#include "core/files/file.h"
#include "pipeline/exchange/bags/files/chunk_compression.h"
#include "pipeline/exchange/bags/image_pixels.h"
#include "pipeline/exchange/bags/messages.h"
#include "tests/pipeline/exchange/bag_writers.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Lists what a bag shows: "/topic type time bytes".
class Listing : public BagVisitor {
 public:
  bool Wants(const BagTopic& topic, int64_t record_time_ns) override {
    times_asked.push_back(record_time_ns);
    return topic.name != "/unwanted";
  }
  Status Take(const BagMessage& message) override {
    lines.push_back(fmt::format("{} {} {} {}", message.topic.name, message.topic.type, message.record_time_ns,
                                message.bytes));
    is_cdr = message.topic.serialization == Serialization::kCdr;
    return Ok();
  }
  std::vector<std::string> lines;
  std::vector<int64_t> times_asked;  // of all messages
  bool is_cdr = false;
};

const std::vector<Recorded> kThree = {{"/a", "sensor_msgs/msg/Image", 10, "one"},
                                      {"/unwanted", "std_msgs/msg/String", 11, "two"},
                                      {"/b", "nav_msgs/msg/Odometry", 12, "three"}};
const auto kTwoLines = ElementsAre("/a sensor_msgs/Image 10 one", "/b nav_msgs/Odometry 12 three");

class BagFiles : public testing::Test {
 protected:
  void SetUp() override {
    root_ = testing::TempDir() + "/bag_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  std::string Write(const std::string& name, const std::string& bytes) {
    std::ofstream(root_ + "/" + name, std::ios::binary) << bytes;
    return root_ + "/" + name;
  }
  // What is read, or the error; the sentences on damage in `damage_`.
  Result<Listing> Read(const std::string& path) {
    CAIRN_ASSIGN_OR_RETURN(const std::unique_ptr<Bag> bag, OpenBag(path));
    Listing first, second;
    CAIRN_ASSIGN_OR_RETURN(damage_, bag->Read(first));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<std::string> again, bag->Read(second));
    EXPECT_EQ(first.lines, second.lines);  // it can be read twice
    EXPECT_EQ(damage_, again);
    return first;
  }
  std::vector<std::string> DamageOf(const std::string& path) {
    const auto listing = Read(path);
    EXPECT_TRUE(listing.ok());
    return damage_;
  }
  std::string ErrorOf(const std::string& path) {
    const auto listing = Read(path);
    return listing.ok() ? "read" : listing.error().message;
  }
  std::string root_;
  std::vector<std::string> damage_;
};

TEST_F(BagFiles, ShowMessagesOfBothStoragesWithTypesAndTimes) {
  WriteDb3(root_ + "/a.db3", kThree);
  std::vector<std::string> paths = {root_ + "/a.db3"};
  for (const char* compression : {"", "lz4", "zstd"}) {
    paths.push_back(
        Write(fmt::format("{}.mcap", compression), McapBytes(kThree, {.compression = compression})));
  }
  paths.push_back(Write("flat.mcap", McapBytes(kThree, {.has_chunks = false})));
  paths.push_back(Write("no_summary.mcap", McapBytes(kThree, {.has_summary = false})));
  for (const std::string& path : paths) {
    SCOPED_TRACE(path);
    EXPECT_TRUE(IsBag(path));
    const auto listing = Read(path);
    ASSERT_TRUE(listing.ok()) << listing.error().message;
    EXPECT_THAT(listing->lines, kTwoLines);
    EXPECT_THAT(listing->times_asked, ElementsAre(10, 11, 12));
    EXPECT_TRUE(listing->is_cdr);
    EXPECT_THAT(damage_, IsEmpty());
  }
}

TEST_F(BagFiles, MessagesThatAreCompressedOneByOneAreUnpacked) {
  const std::string text(5000, 'x');
  WriteDb3(root_ + "/a.db3", {{"/a", "sensor_msgs/msg/Image", 10, PackZstd(text)},
                              {"/a", "sensor_msgs/msg/Image", 11, PackZstd(text).substr(0, 8)}});
  const auto listing = Read(root_ + "/a.db3");
  ASSERT_TRUE(listing.ok());
  EXPECT_THAT(listing->lines, ElementsAre("/a sensor_msgs/Image 10 " + text));
  EXPECT_THAT(damage_, ElementsAre(HasSubstr("1 messages of no topic, or that cannot be unpacked")));
}

TEST_F(BagFiles, FoldersHaveTheFilesOfTheirMetadataElseAllInTheOrderOfNames) {
  WriteDb3(root_ + "/run_10.db3", {{"/a", "t", 3, "third"}});
  WriteDb3(root_ + "/run_9.db3", {{"/a", "t", 2, "second"}});
  EXPECT_THAT(Read(root_)->lines, ElementsAre("/a t 2 second", "/a t 3 third"));
  // Files in the order that is stated; an old version states the folder's name too.
  Write("metadata.yaml",
        "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    - run_10.db3\n    - "
        "run/run_9.db3\n");
  EXPECT_THAT(Read(root_)->lines, ElementsAre("/a t 3 third", "/a t 2 second"));
  Write("metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [gone.db3]\n");
  EXPECT_THAT(ErrorOf(root_), HasSubstr("lists gone.db3, which is not there"));
  Write("metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [../../etc/passwd]\n");
  EXPECT_THAT(ErrorOf(root_), HasSubstr("lists passwd, which is not there"));
  // A file that is there, but outside.
  fs::create_directories(root_ + "/inner");
  Write("inner/metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [../run_9.db3]\n");
  EXPECT_THAT(ErrorOf(root_ + "/inner"), HasSubstr("lists run_9.db3, which is not there"));
  Write("metadata.yaml", "name: [");
  EXPECT_THAT(ErrorOf(root_), HasSubstr("metadata.yaml: YAML says"));
  Write("metadata.yaml", "just text");
  EXPECT_THAT(ErrorOf(root_), HasSubstr("metadata.yaml"));
  Write("metadata.yaml", "name: x");
  EXPECT_THAT(ErrorOf(root_), HasSubstr("not a bag's metadata"));
}

TEST_F(BagFiles, WhatIsNoBagIsSaid) {
  EXPECT_THAT(ErrorOf(root_), HasSubstr("no bag in it"));
  EXPECT_THAT(ErrorOf(Write("zero.db3", "")), HasSubstr("zero.db3: no bytes"));
  EXPECT_THAT(ErrorOf(Write("zero.mcap", "")), HasSubstr("zero.mcap: no bytes"));
  EXPECT_THAT(ErrorOf(Write("wrong.mcap", "MCAP0 and more")), HasSubstr("wrong.mcap: not a bag"));
  EXPECT_THAT(ErrorOf(Write("next.mcap", "\x89MCAP1\r\n....")),
              HasSubstr("does not begin as MCAP, version 0"));
  EXPECT_THAT(ErrorOf(Write("head.mcap", "\x89MCAP")), HasSubstr("is it truncated?"));
  EXPECT_THAT(ErrorOf(Write("a.db3.zstd", PackZstd("x"))), HasSubstr("unpack it with unzstd"));
  EXPECT_THAT(ErrorOf(root_ + "/absent.db3"), HasSubstr("absent.db3"));
}

TEST_F(BagFiles, SqliteFilesOfOthersAreRefused) {
  const std::string path = root_ + "/colmap.db3";
  SQLite::Database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
      .exec("CREATE TABLE images(id INTEGER)");
  EXPECT_THAT(ErrorOf(path), HasSubstr("not one that rosbag2 wrote"));
  EXPECT_EQ(OpenBag(path).error().code, ErrorCode::kUnsupported);
  const std::string view = root_ + "/view.db3";
  SQLite::Database(view, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
      .exec("CREATE VIEW topics AS SELECT 1 AS id, 'a' AS name, 't' AS type, 'cdr' AS serialization_format");
  EXPECT_THAT(ErrorOf(view), HasSubstr("not one that rosbag2 wrote"));
}

TEST_F(BagFiles, TruncatedSqliteFilesAreSaid) {
  WriteDb3(root_ + "/a.db3", {{"/a", "t", 1, std::string(30000, 'x')}, {"/a", "t", 2, "y"}});
  const std::string bytes = *ReadFile(root_ + "/a.db3");
  for (const size_t size : {bytes.size() - 4096, bytes.size() - 1, size_t{4096}}) {
    EXPECT_EQ(OpenBag(Write("cut.db3", bytes.substr(0, size))).error().code, ErrorCode::kTruncated) << size;
    EXPECT_THAT(ErrorOf(root_ + "/cut.db3"), HasSubstr("the file was cut off"));
  }
}

TEST_F(BagFiles, MessagesBeforeADamagedPageOfSqliteAreRead) {
  std::vector<Recorded> messages;
  for (int i = 0; i < 200; ++i) messages.push_back({"/a", "t", i, std::string(1000, 'x')});
  WriteDb3(root_ + "/a.db3", messages);
  std::string bytes = *ReadFile(root_ + "/a.db3");
  // Pages of four kilobytes have four messages each: the second half of them is overwritten.
  std::fill(bytes.begin() + 25 * 4096, bytes.begin() + 40 * 4096, '\xff');
  const auto listing = Read(Write("damaged.db3", bytes));
  ASSERT_TRUE(listing.ok()) << listing.error().message;
  EXPECT_GT(listing->lines.size(), 50u);
  EXPECT_LT(listing->lines.size(), 150u);
  EXPECT_THAT(damage_,
              ElementsAre(HasSubstr(fmt::format("the {} messages before are read", listing->lines.size()))));
}

TEST_F(BagFiles, AWriteAheadLogThatIsNotReadIsSaid) {
  WriteDb3(root_ + "/a.db3", kThree);
  Write("a.db3-wal", "what a killed recorder left");
  EXPECT_THAT(Read(root_ + "/a.db3")->lines, kTwoLines);
  EXPECT_THAT(damage_, ElementsAre(HasSubstr("a.db3-wal beside it has messages that are not read")));
}

// At any length a file gives a beginning of what the whole one shows, and says what is missing.
TEST_F(BagFiles, TruncatedMcapFilesGiveWhatIsWhole) {
  const std::vector<Recorded> four = {
      {"/a", "t", 1, "one"}, {"/a", "t", 2, "two"}, {"/b", "u", 3, "three"}, {"/a", "t", 4, "four"}};
  const std::vector<std::string> lines = {"/a t 1 one", "/a t 2 two", "/b u 3 three", "/a t 4 four"};
  for (const McapForm& form : {McapForm{}, McapForm{.compression = "zstd"}, McapForm{.has_chunks = false}}) {
    const std::string bytes = McapBytes(four, form);
    size_t most = 0;
    for (size_t size = 8; size < bytes.size(); ++size) {
      const auto listing = Read(Write("cut.mcap", bytes.substr(0, size)));
      ASSERT_TRUE(listing.ok()) << listing.error().message;
      ASSERT_LE(listing->lines.size(), lines.size());
      ASSERT_TRUE(std::equal(listing->lines.begin(), listing->lines.end(), lines.begin())) << size;
      EXPECT_GE(listing->lines.size(), most) << size;
      most = listing->lines.size();
      EXPECT_EQ(damage_.size(), 1u) << size;
    }
    EXPECT_EQ(most, 4u);
  }
}

TEST_F(BagFiles, ChunksWithAWrongChecksumAreLeftOutAndTheRestIsRead) {
  // The first chunk has the channels: they are found in the summary.
  std::string bytes = McapBytes({{"/a", "t", 1, "one"}, {"/a", "t", 2, "two"}, {"/a", "t", 3, "three"}});
  bytes[bytes.find("one")] = 'O';
  EXPECT_THAT(Read(Write("a.mcap", bytes))->lines, ElementsAre("/a t 3 three"));
  EXPECT_THAT(damage_, ElementsAre(HasSubstr("1 damaged chunks are left out")));
  EXPECT_THAT(damage_, ElementsAre(HasSubstr("its checksum is ")));
  // Without summary nothing says what the messages are.
  bytes = McapBytes({{"/a", "t", 1, "one"}, {"/a", "t", 2, "two"}, {"/a", "t", 3, "three"}},
                    {.has_summary = false});
  bytes[bytes.find("one")] = 'O';
  EXPECT_THAT(Read(Write("b.mcap", bytes))->lines, IsEmpty());
  EXPECT_THAT(damage_, ElementsAre(HasSubstr("1 damaged chunks"), HasSubstr("1 damaged records")));
}

TEST_F(BagFiles, ChecksumsThatWereNotComputedAreNotCompared) {
  std::string bytes = McapBytes(kThree);
  const size_t chunk = bytes.find('\x06', 8 + 9);  // after magic and header's head
  std::fill_n(bytes.begin() + static_cast<long>(chunk) + 9 + 24, 4, '\0');
  EXPECT_THAT(Read(Write("a.mcap", bytes))->lines, kTwoLines);
  EXPECT_THAT(damage_, IsEmpty());
}

TEST_F(BagFiles, LengthsThatLieAllocateNothingAndAreSaid) {
  const std::string head = McapBytes({}, {.has_chunks = false, .has_summary = false}).substr(0, 8);
  const uint64_t huge = uint64_t{1} << 62;
  const std::string good = McapChunk("", "");
  // A record beyond the end of the file.
  EXPECT_TRUE(Read(Write("a.mcap", head + BytesOf(uint8_t{6}) + BytesOf(huge) + good)).ok());
  EXPECT_THAT(damage_, ElementsAre(HasSubstr("or a length in it is wrong")));
  const auto chunk = [&](uint64_t num_unpacked, const std::string& compression, uint64_t num_packed,
                         const std::string& packed) {
    return McapRecord(6, std::string(16, '\0') + BytesOf(num_unpacked) + BytesOf(uint32_t{0}) +
                             McapText(compression) + BytesOf(num_packed) + packed);
  };
  const std::string zstd = PackZstd(std::string(1000, 'x'));
  const std::string lz4 = PackLz4(std::string(1000, 'x'));
  for (const auto& [bytes, sentence] : std::vector<std::pair<std::string, std::string>>{
           {chunk(huge, "zstd", zstd.size(), zstd), "more than 1073741824"},
           {chunk(1 << 30, "zstd", zstd.size(), zstd), "1000 bytes come out of it, stated are 1073741824"},
           {chunk(999, "zstd", zstd.size(), zstd), "more than 999 bytes come out of it"},
           {chunk(1 << 30, "lz4", lz4.size(), lz4), "1000 bytes come out of it"},
           {chunk(10, "lz4", lz4.size(), lz4), "more than 10 bytes come out of it"},
           {chunk(1000, "lz4", lz4.size() - 9, lz4.substr(9)), "LZ4 says"},
           {chunk(1000, "zstd", zstd.size() - 3, zstd.substr(0, zstd.size() - 3)), "ends in the middle"},
           {chunk(4, "", huge, "abcd"), "lengths in it that are not those of the chunk"},
           {chunk(4, "brotli", 4, "abcd"), "its compression is 'brotli'"},
       }) {
    EXPECT_TRUE(Read(Write("b.mcap", head + bytes)).ok());
    EXPECT_EQ(damage_.size(), 2u);  // it was not closed either
    EXPECT_THAT(damage_.back(), HasSubstr(sentence));
  }
  // A record inside a chunk that is longer than the chunk.
  EXPECT_TRUE(Read(Write("c.mcap", head + McapChunk(BytesOf(uint8_t{5}) + BytesOf(huge) + "ab", ""))).ok());
  EXPECT_THAT(damage_.back(), HasSubstr("1 damaged records"));
}

const std::vector<Recorded> kThreeOfRos1 = {{"/a", "sensor_msgs/Image", 10, "one"},
                                            {"/unwanted", "std_msgs/String", 11, "two"},
                                            {"/b", "nav_msgs/Odometry", 2'000'000'012, "three"}};

TEST_F(BagFiles, OfRos1ShowTheirMessages) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    SCOPED_TRACE(compression);
    const std::string path =
        Write(fmt::format("{}.bag", compression), Ros1BagBytes(kThreeOfRos1, {.compression = compression}));
    EXPECT_TRUE(IsBag(path));
    const auto listing = Read(path);
    ASSERT_TRUE(listing.ok()) << listing.error().message;
    EXPECT_THAT(listing->lines,
                ElementsAre("/a sensor_msgs/Image 10 one", "/b nav_msgs/Odometry 2000000012 three"));
    EXPECT_THAT(listing->times_asked, ElementsAre(10, 11, 2'000'000'012));
    EXPECT_FALSE(listing->is_cdr);
    EXPECT_THAT(damage_, IsEmpty());
  }
  EXPECT_THAT(DamageOf(Write("open.bag", Ros1BagBytes(kThreeOfRos1, {.is_closed = false}))),
              ElementsAre(HasSubstr("the recording was not closed")));
  EXPECT_THAT(ErrorOf(Write("old.bag", "#ROSBAG V1.2\n")), HasSubstr("another version of ROS 1 than 2.0"));
}

TEST_F(BagFiles, OfRos1ThatAreTruncatedGiveWhatIsWhole) {
  const std::vector<std::string> lines = {"/a t 1 one", "/a t 2 two", "/b u 3 three", "/a t 4 four"};
  const std::string bytes = Ros1BagBytes(
      {{"/a", "t", 1, "one"}, {"/a", "t", 2, "two"}, {"/b", "u", 3, "three"}, {"/a", "t", 4, "four"}});
  size_t most = 0;
  for (size_t size = 13; size < bytes.size(); ++size) {
    const auto listing = Read(Write("cut.bag", bytes.substr(0, size)));
    ASSERT_TRUE(listing.ok()) << listing.error().message;
    ASSERT_LE(listing->lines.size(), lines.size());
    ASSERT_TRUE(std::equal(listing->lines.begin(), listing->lines.end(), lines.begin())) << size;
    EXPECT_GE(listing->lines.size(), most) << size;
    most = listing->lines.size();
  }
  EXPECT_EQ(most, 4u);
  EXPECT_THAT(DamageOf(Write("cut.bag", bytes.substr(0, bytes.size() / 2))),
              ElementsAre(HasSubstr("ends in the middle of a record")));
}

TEST_F(BagFiles, OfRos1WithDamagedChunksOrLengthsGiveTheRest) {
  // The first chunk has the connections: they are found at the end.
  const std::vector<Recorded> messages = {
      {"/a", "t", 1, "one"}, {"/a", "t", 2, "two"}, {"/a", "t", 3, "three"}};
  for (const char* compression : {"lz4", "bz2"}) {
    std::string bytes = Ros1BagBytes(messages, {.compression = compression});
    const size_t chunk = bytes.find("compression=") + 40;
    std::fill_n(bytes.begin() + static_cast<long>(chunk), 20, '\xee');
    EXPECT_THAT(Read(Write("a.bag", bytes))->lines, ElementsAre("/a t 3 three"));
    EXPECT_THAT(damage_, ElementsAre(HasSubstr("1 damaged chunks are left out")));
  }
  const std::string head = Ros1BagBytes({});
  const std::string huge = BytesOf(uint32_t{0xfffffff0});
  const std::vector<std::pair<std::string, std::string>> chunk = {
      {"op", "\5"}, {"compression", "none"}, {"size", huge}};
  EXPECT_THAT(DamageOf(Write("b.bag", head + huge + "op")),
              ElementsAre(HasSubstr("or a length in it is wrong")));
  EXPECT_THAT(DamageOf(Write("c.bag", head + Ros1Record(chunk, "abc"))),
              ElementsAre(HasSubstr("more than 1073741824")));
  EXPECT_THAT(
      DamageOf(Write(
          "d.bag", head + Ros1Record({{"op", "\5"}, {"compression", "none"}, {"size", BytesOf(uint32_t{6})}},
                                     huge + "ab"))),
      ElementsAre(HasSubstr("1 damaged records")));
  // A message of a connection that nothing describes; a record without an operation.
  EXPECT_THAT(
      DamageOf(
          Write("e.bag",
                head +
                    Ros1Record({{"op", "\2"}, {"conn", BytesOf(uint32_t{9})}, {"time", BytesOf(uint64_t{1})}},
                               "x") +
                    Ros1Record({}, "x"))),
      ElementsAre(HasSubstr("2 damaged records")));
}

// Decodes all that it is shown, as an import would.
class Decoder : public BagVisitor {
 public:
  bool Wants(const BagTopic&, int64_t) override { return true; }
  Status Take(const BagMessage& message) override {
    int64_t num_invalid = 0;
    if (const auto image = DecodeImage(message); image.ok()) num_decoded += PictureOf(*image).ok();
    if (const auto image = DecodeCompressedImage(message); image.ok()) num_decoded += PictureOf(*image).ok();
    num_decoded += DecodeCameraInfo(message).ok() + DecodeOdometry(message).ok();
    num_decoded += DecodeTransforms(message, &num_invalid).ok();
    return Ok();
  }
  int num_decoded = 0;
};

TEST_F(BagFiles, DamagedAnywhereAreReadOrRefused) {
  const std::vector<Recorded> messages = {
      {"/i", "sensor_msgs/Image", 1,
       ImageBytes({.width = 2, .height = 2, .encoding = "bgr8", .pixels = "123456123456"})},
      {"/c", "sensor_msgs/CameraInfo", 2, CameraInfoBytes({.d = {1, 2, 3, 4, 5}})},
      {"/odom", "nav_msgs/Odometry", 3, OdometryBytes(7, {})},
      {"/tf", "tf2_msgs/TFMessage", 4, TransformBytes({{"a", "b", {}}, {"b", "c", {}}})},
      {"/j", "sensor_msgs/CompressedImage", 5, CompressedImageBytes(1, "jpeg", "\xff\xd8no")}};
  WriteDb3(root_ + "/whole.db3", messages);
  const std::vector<std::string> wholes = {*ReadFile(root_ + "/whole.db3"),
                                           McapBytes(messages, {.has_chunks = false}),
                                           McapBytes(messages),
                                           McapBytes(messages, {.compression = "lz4"}),
                                           McapBytes(messages, {.compression = "zstd"}),
                                           Ros1BagBytes(messages),
                                           Ros1BagBytes(messages, {.compression = "bz2"})};
  std::mt19937 random(1);
  for (const std::string& whole : wholes) {
    for (int i = 0; i < 150; ++i) {
      std::string bytes = whole;
      for (int k = 0; k < 1 + i % 5; ++k) {
        // Lengths and flags are most often changed to what is far away.
        const size_t place = random() % bytes.size();
        bytes[place] = static_cast<char>(i % 2 == 0 ? 0xff : random() % 256);
      }
      const auto bag = OpenBag(Write("damaged", bytes));
      if (!bag.ok()) continue;
      Decoder decoder;
      const auto damage = (*bag)->Read(decoder);
      EXPECT_THAT(damage.ok() ? "damaged" : damage.error().message, HasSubstr("damaged"));  // the file's name
      EXPECT_LE(decoder.num_decoded, 50);
    }
  }
}

TEST_F(BagFiles, ChunksAreUnpackedIntoNoMoreThanComesOut) {
  const std::string text(100'000, 'x');
  EXPECT_EQ(*UnpackChunk("zstd", PackZstd(text), text.size()), text);
  EXPECT_EQ(*UnpackChunk("lz4", PackLz4(text), text.size()), text);
  EXPECT_EQ(*UnpackChunk("bz2", PackBzip2(text), text.size()), text);
  EXPECT_EQ(*UnpackChunk("", "", 0), "");
  const auto short_one = UnpackChunk("zstd", PackZstd(text), 1 << 30);
  ASSERT_FALSE(short_one.ok());
  EXPECT_THAT(short_one.error().message, HasSubstr("100000 bytes come out"));
}

}  // namespace
}  // namespace cairn::pipeline
