#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/exchange/bags/files/bag.h"
#include "tests/pipeline/exchange/bag_writers.h"

namespace cairn::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class Contents : public BagVisitor {
 public:
  bool Wants(const BagTopic&, int64_t) override { return true; }
  Status Take(const BagMessage& message) override {
    messages.emplace_back(message.bytes);
    return Ok();
  }
  std::vector<std::string> messages;
};

class Ros1BagFile : public testing::Test {
 protected:
  Result<std::vector<std::string>> Read(const std::string& bytes) {
    const std::string path = testing::TempDir() + "/ros1_bag_test.bag";
    // Not synced, as thousands are written.
    std::ofstream(path, std::ios::binary) << bytes;
    Contents contents;
    CAIRN_ASSIGN_OR_RETURN(const std::unique_ptr<Bag> bag, OpenBag(path));
    CAIRN_ASSIGN_OR_RETURN(damage_, bag->Read(contents));
    return contents.messages;
  }
  std::vector<std::string> damage_;
};

const std::vector<Recorded> kTwo = {{"/a", "sensor_msgs/Image", 1, "one"},
                                    {"/a", "sensor_msgs/Image", 2, "two"}};

// rosbag writes the head of a chunk with a length of 0, and the right one when the chunk is full: of a
// recording that was killed, the messages of the last chunk stand behind its empty head.
TEST_F(Ros1BagFile, RecordingsThatWereKilledGiveTheirLastChunkToo) {
  const std::string bytes = Ros1BagBytes(kTwo, {.is_closed = false});
  const std::string unfinished =
      Ros1Record({{"op", "\5"}, {"compression", "none"}, {"size", BytesOf(uint32_t{0})}}, "") +
      Ros1Record({{"op", "\2"}, {"conn", BytesOf(uint32_t{1})}, {"time", BytesOf(uint64_t{3})}}, "three") +
      Ros1Record({{"op", "\2"}, {"conn", BytesOf(uint32_t{1})}, {"time", BytesOf(uint64_t{4})}}, "four");
  const auto messages = Read(bytes + unfinished);
  ASSERT_TRUE(messages.ok()) << messages.error().message;
  EXPECT_THAT(*messages, ElementsAre("one", "two", "three", "four"));
  EXPECT_THAT(damage_, ElementsAre(HasSubstr("the recording was not closed")));
}

TEST_F(Ros1BagFile, EncryptedBagsAreRefused) {
  const auto messages = Read(
      "#ROSBAG V2.0\n" +
      Ros1Record({{"op", "\3"}, {"index_pos", BytesOf(uint64_t{0})}, {"encryptor", "rosbag/AesCbcEncryptor"}},
                 ""));
  ASSERT_FALSE(messages.ok());
  EXPECT_EQ(messages.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(messages.error().message, HasSubstr("encrypted by rosbag/AesCbcEncryptor"));
}

TEST_F(Ros1BagFile, OfWhichAnyByteIsWrongShowsNoMoreMessagesThanItHas) {
  const std::string whole = Ros1BagBytes(kTwo, {.compression = "lz4", .messages_per_chunk = 1});
  for (size_t place = 0; place < whole.size(); ++place) {
    std::string bytes = whole;
    bytes[place] = static_cast<char>(bytes[place] ^ (1 << place % 8));
    if (const auto messages = Read(bytes); messages.ok()) {
      EXPECT_LE(messages->size(), 2u) << place;
    }
  }
}

}  // namespace
}  // namespace cairn::pipeline
