#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"

namespace cairn::pipeline {

// How a message's fields become bytes.
enum class Serialization {
  kCdr,      // ROS 2: OMG's Common Data Representation, with its four bytes of head
  kRos1,     // ROS 1: little-endian, nothing aligned
  kUnknown,  // something else: such messages are counted, but not read
};

struct BagTopic {
  std::string name;  // "/camera/image_raw"
  std::string type;  // "sensor_msgs/Image", of ROS 2 too
  Serialization serialization = Serialization::kUnknown;
};

struct BagMessage {
  const BagTopic& topic;
  int64_t record_time_ns = 0;  // when it was recorded, since 1970
  std::string_view bytes;      // valid until the visitor returns
};

// Takes the messages of a bag.
class BagVisitor {
 public:
  virtual ~BagVisitor() = default;
  // Asked for every message that is there, with the time at which it was recorded, since 1970.  Those that
  // are not wanted cost little.
  virtual bool Wants(const BagTopic& topic, int64_t record_time_ns) = 0;
  // An error ends the reading and is returned by it.
  virtual Status Take(const BagMessage& message) = 0;
};

// What robots record: messages with topics and times.
class Bag {
 public:
  virtual ~Bag() = default;
  // Shows all messages in the order of the file, which is that of recording.  Memory: one message, or one
  // chunk of those (at most 1 GiB).  What is damaged is passed over; returned are the sentences that say what
  // and where.  Errors: those of the visitor, Io; Corrupt, Unsupported where nothing can be read.
  virtual Result<std::vector<std::string>> Read(BagVisitor& visitor) = 0;
};

// Opens a bag of ROS 2 (SQLite's .db3, .mcap) or ROS 1 (.bag); or a folder of them, recorded one after the
// other: those that metadata.yaml lists, in its order; without it all that are there, in the order of names.
// Errors: NotFound, EmptyFile, Corrupt (not a bag; a metadata.yaml that is none), Unsupported (files that are
// compressed as a whole), NoData (a folder without bags).
Result<std::unique_ptr<Bag>> OpenBag(const std::string& path);

// One kind of file each.  Errors: Corrupt, Unsupported (another version of the schema).
Result<std::unique_ptr<Bag>> OpenSqliteBag(const std::string& path);
Result<std::unique_ptr<Bag>> OpenMcapBag(const std::string& path);
Result<std::unique_ptr<Bag>> OpenRos1Bag(const std::string& path);

// "sensor_msgs/Image" from ROS 2's "sensor_msgs/msg/Image".
std::string TypeWithoutMsg(const std::string& type);

}  // namespace cairn::pipeline
