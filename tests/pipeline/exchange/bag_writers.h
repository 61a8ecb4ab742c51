#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>
#include <bzlib.h>
#include <gtest/gtest.h>
#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>
#include <Eigen/Geometry>

#include "core/geometry/pose.h"

namespace cairn::pipeline {

// Bags as the recorders of ROS write them, for tests: messages, and the files that they stand in.

// Bytes of numbers as they stand in memory: little-endian.
template <class T>
std::string BytesOf(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

enum class MessageForm { kCdr, kCdrBigEndian, kRos1 };

// The fields of a message, one after the other.
class MessageWriter {
 public:
  explicit MessageWriter(MessageForm form) : form_(form) {}
  template <class T>
  MessageWriter& Put(T value) {
    std::string bytes = BytesOf(value);
    if (form_ == MessageForm::kCdrBigEndian) bytes = std::string(bytes.rbegin(), bytes.rend());
    if (form_ != MessageForm::kRos1) body_.resize((body_.size() + sizeof(T) - 1) / sizeof(T) * sizeof(T));
    body_ += bytes;
    return *this;
  }
  MessageWriter& Text(const std::string& text) {
    const std::string ended = form_ == MessageForm::kRos1 ? text : text + '\0';
    Put(static_cast<uint32_t>(ended.size()));
    body_ += ended;
    return *this;
  }
  MessageWriter& Bytes(std::string_view bytes) {
    Put(static_cast<uint32_t>(bytes.size()));
    body_ += bytes;
    return *this;
  }
  MessageWriter& Header(int64_t stamp_ns, const std::string& frame) {
    if (form_ == MessageForm::kRos1) Put(uint32_t{7});  // seq
    Put(static_cast<int32_t>(stamp_ns / 1'000'000'000)).Put(static_cast<uint32_t>(stamp_ns % 1'000'000'000));
    return Text(frame);
  }
  MessageWriter& PutPose(const Pose& pose) {
    for (const double value : {pose.translation.x(), pose.translation.y(), pose.translation.z()}) Put(value);
    const Eigen::Quaterniond& q = pose.rotation;
    for (const double value : {q.x(), q.y(), q.z(), q.w()}) Put(value);
    return *this;
  }
  std::string bytes() const {
    if (form_ == MessageForm::kRos1) return body_;
    return std::string{'\0', form_ == MessageForm::kCdr ? '\1' : '\0', '\0', '\0'} + body_;
  }

 private:
  MessageForm form_;
  std::string body_;
};

struct RawImage {
  int64_t stamp_ns = 0;
  int width = 0, height = 0;
  std::string encoding = "mono8";
  std::string pixels;
  int step = 0;  // 0: of the first row's share of the pixels
  bool is_big_endian = false;
  std::string frame = "camera_optical";
};
inline std::string ImageBytes(const RawImage& image, MessageForm form = MessageForm::kCdr) {
  const size_t step = image.step != 0 ? image.step : image.pixels.size() / std::max(1, image.height);
  return MessageWriter(form)
      .Header(image.stamp_ns, image.frame)
      .Put(static_cast<uint32_t>(image.height))
      .Put(static_cast<uint32_t>(image.width))
      .Text(image.encoding)
      .Put(static_cast<uint8_t>(image.is_big_endian))
      .Put(static_cast<uint32_t>(step))
      .Bytes(image.pixels)
      .bytes();
}

inline std::string CompressedImageBytes(int64_t stamp_ns, const std::string& format, std::string_view file,
                                        MessageForm form = MessageForm::kCdr) {
  return MessageWriter(form).Header(stamp_ns, "camera_optical").Text(format).Bytes(file).bytes();
}

struct CameraInfoFields {
  int width = 8, height = 6;
  std::string model = "plumb_bob";
  std::vector<double> d;
  std::array<double, 9> k = {10, 0, 4, 0, 11, 3, 0, 0, 1};
  std::array<double, 12> p = {9, 0, 3.5, 0, 0, 9, 2.5, 0, 0, 0, 1, 0};
  uint32_t binning = 0;
  uint32_t roi_x = 0, roi_y = 0, roi_height = 0, roi_width = 0;
};
inline std::string CameraInfoBytes(const CameraInfoFields& info, MessageForm form = MessageForm::kCdr) {
  MessageWriter writer(form);
  writer.Header(1'000'000'000, "camera_optical");
  writer.Put(static_cast<uint32_t>(info.height)).Put(static_cast<uint32_t>(info.width)).Text(info.model);
  writer.Put(static_cast<uint32_t>(info.d.size()));
  for (const double value : info.d) writer.Put(value);
  for (const double value : info.k) writer.Put(value);
  for (const double value : {1, 0, 0, 0, 1, 0, 0, 0, 1}) writer.Put(value);  // R
  for (const double value : info.p) writer.Put(value);
  for (const uint32_t value :
       {info.binning, info.binning, info.roi_x, info.roi_y, info.roi_height, info.roi_width})
    writer.Put(value);
  return writer.Put(uint8_t{0}).bytes();
}

inline std::string OdometryBytes(int64_t stamp_ns, const Pose& odom_from_base,
                                 MessageForm form = MessageForm::kCdr) {
  MessageWriter writer(form);
  writer.Header(stamp_ns, "odom").Text("base_link").PutPose(odom_from_base);
  for (int i = 0; i < 36 + 6 + 36; ++i) writer.Put(0.0);  // covariance, twist and its covariance
  return writer.bytes();
}

struct ImuFields {
  int64_t stamp_ns = 0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), accel = {0, 0, 9.8};
  std::string frame = "imu_link";
  bool has_accel = true;
};
inline std::string ImuBytes(const ImuFields& imu, MessageForm form = MessageForm::kCdr) {
  MessageWriter writer(form);
  writer.Header(imu.stamp_ns, imu.frame);
  for (int i = 0; i < 4 + 9; ++i) writer.Put(0.0);  // orientation and its covariance
  for (const double value : {imu.turn.x(), imu.turn.y(), imu.turn.z()}) writer.Put(value);
  for (int i = 0; i < 9; ++i) writer.Put(0.0);
  for (const double value : {imu.accel.x(), imu.accel.y(), imu.accel.z()}) writer.Put(value);
  writer.Put(imu.has_accel ? 0.0 : -1.0);
  for (int i = 1; i < 9; ++i) writer.Put(0.0);
  return writer.bytes();
}

struct FrameLink {
  std::string parent, child;
  Pose parent_from_child;
  int64_t stamp_ns = 0;
};
inline std::string TransformBytes(const std::vector<FrameLink>& links, MessageForm form = MessageForm::kCdr) {
  MessageWriter writer(form);
  writer.Put(static_cast<uint32_t>(links.size()));
  for (const FrameLink& link : links)
    writer.Header(link.stamp_ns, link.parent).Text(link.child).PutPose(link.parent_from_child);
  return writer.bytes();
}

// A message of a bag.
struct Recorded {
  std::string topic;
  std::string type;  // "sensor_msgs/msg/Image"
  int64_t time_ns = 0;
  std::string bytes;
};

// Topics of messages, numbered from 1 in the order in which they come.
inline std::map<std::string, int> TopicNumbers(const std::vector<Recorded>& messages) {
  std::map<std::string, int> numbers;
  for (const Recorded& message : messages)
    numbers.emplace(message.topic, static_cast<int>(numbers.size()) + 1);
  return numbers;
}

// rosbag2's SQLite storage.
inline void WriteDb3(const std::string& path, const std::vector<Recorded>& messages) {
  SQLite::Database database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec("PRAGMA synchronous = OFF");
  database.exec(
      "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
      "INSERT INTO schema VALUES (4, 'jazzy');"
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
      " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,"
      " type_description_hash TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
      " data BLOB NOT NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC); BEGIN");
  const std::map<std::string, int> numbers = TopicNumbers(messages);
  std::map<int, bool> is_listed;
  for (const Recorded& message : messages) {
    const int number = numbers.at(message.topic);
    if (!is_listed[number]) {
      SQLite::Statement topic(database, "INSERT INTO topics VALUES (?, ?, ?, 'cdr', '', '')");
      topic.bind(1, number);
      topic.bind(2, message.topic);
      topic.bind(3, message.type);
      topic.exec();
      is_listed[number] = true;
    }
    SQLite::Statement row(database, "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)");
    row.bind(1, number);
    row.bind(2, message.time_ns);
    row.bind(3, message.bytes.data(), static_cast<int>(message.bytes.size()));
    row.exec();
  }
  database.exec("COMMIT");
}

inline std::string PackLz4(const std::string& bytes) {
  std::string packed(LZ4F_compressFrameBound(bytes.size(), nullptr), '\0');
  packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr));
  return packed;
}
inline std::string PackZstd(const std::string& bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 3));
  return packed;
}

struct McapForm {
  std::string compression;  // "", "lz4", "zstd"; of chunks
  bool has_chunks = true;
  bool has_summary = true;     // with schemas and channels again
  int messages_per_chunk = 2;  // the first chunk has the channels
  std::string encoding = "cdr";
};

inline std::string McapText(const std::string& text) {
  return BytesOf(static_cast<uint32_t>(text.size())) + text;
}
inline std::string McapRecord(uint8_t opcode, const std::string& content) {
  return BytesOf(opcode) + BytesOf(static_cast<uint64_t>(content.size())) + content;
}
inline uint32_t Crc32(const std::string& bytes) {
  return static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const unsigned char*>(bytes.data()), static_cast<unsigned>(bytes.size())));
}

inline std::string McapChunk(const std::string& records, const std::string& compression) {
  const std::string packed = compression == "lz4"    ? PackLz4(records)
                             : compression == "zstd" ? PackZstd(records)
                                                     : records;
  return McapRecord(6, BytesOf(uint64_t{0}) + BytesOf(uint64_t{0}) +
                           BytesOf(static_cast<uint64_t>(records.size())) + BytesOf(Crc32(records)) +
                           McapText(compression) + BytesOf(static_cast<uint64_t>(packed.size())) + packed);
}

// The bytes of an MCAP file.
inline std::string McapBytes(const std::vector<Recorded>& messages, const McapForm& form = {}) {
  constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
  std::string channels;
  const std::map<std::string, int> numbers = TopicNumbers(messages);
  std::map<int, bool> is_listed;
  for (const Recorded& message : messages) {
    const auto number = static_cast<uint16_t>(numbers.at(message.topic));
    if (is_listed[number]) continue;
    is_listed[number] = true;
    channels +=
        McapRecord(3, BytesOf(number) + McapText(message.type) + McapText("ros2msg") + McapText("..."));
    channels += McapRecord(4, BytesOf(number) + BytesOf(number) + McapText(message.topic) +
                                  McapText(form.encoding) + McapText(""));
  }
  std::string bytes = std::string(kMagic) + McapRecord(1, McapText("ros2") + McapText("test"));
  std::string chunk = channels;
  int num_in_chunk = 0;
  const auto end_chunk = [&] {
    if (!chunk.empty()) bytes += form.has_chunks ? McapChunk(chunk, form.compression) : chunk;
    chunk.clear();
    num_in_chunk = 0;
  };
  for (const Recorded& message : messages) {
    const auto number = static_cast<uint16_t>(numbers.at(message.topic));
    chunk += McapRecord(5, BytesOf(number) + BytesOf(uint32_t{0}) + BytesOf(message.time_ns) +
                               BytesOf(message.time_ns) + message.bytes);
    if (++num_in_chunk == form.messages_per_chunk) end_chunk();
  }
  end_chunk();
  bytes += McapRecord(15, BytesOf(uint32_t{0}));
  const uint64_t summary = form.has_summary ? bytes.size() : 0;
  if (form.has_summary) bytes += channels;
  bytes += McapRecord(2, BytesOf(summary) + BytesOf(uint64_t{0}) + BytesOf(uint32_t{0}));
  return bytes + std::string(kMagic);
}

inline std::string PackBzip2(const std::string& bytes) {
  auto size = static_cast<unsigned>(bytes.size() + bytes.size() / 100 + 600);
  std::string packed(size, '\0');
  BZ2_bzBuffToBuffCompress(packed.data(), &size, const_cast<char*>(bytes.data()),
                           static_cast<unsigned>(bytes.size()), 9, 0, 0);
  packed.resize(size);
  return packed;
}

inline std::string Ros1Fields(const std::vector<std::pair<std::string, std::string>>& fields) {
  std::string bytes;
  for (const auto& [name, value] : fields) bytes += McapText(name + "=" + value);
  return bytes;
}
inline std::string Ros1Record(const std::vector<std::pair<std::string, std::string>>& head,
                              const std::string& contents) {
  return McapText(Ros1Fields(head)) + McapText(contents);
}

struct Ros1Form {
  std::string compression = "none";  // "lz4", "bz2"
  bool is_closed = true;             // else without connections at the end
  int messages_per_chunk = 2;
};

// The bytes of a ROS 1 bag.
inline std::string Ros1BagBytes(const std::vector<Recorded>& messages, const Ros1Form& form = {}) {
  constexpr char kFirstLine[] = "#ROSBAG V2.0\n";
  std::string body, chunk, connections;
  const std::map<std::string, int> numbers = TopicNumbers(messages);
  std::map<int, bool> is_listed;
  int num_in_chunk = 0;
  const auto end_chunk = [&] {
    const std::string packed = form.compression == "lz4"   ? PackLz4(chunk)
                               : form.compression == "bz2" ? PackBzip2(chunk)
                                                           : chunk;
    if (num_in_chunk > 0) {
      body += Ros1Record({{"op", "\5"},
                          {"compression", form.compression},
                          {"size", BytesOf(static_cast<uint32_t>(chunk.size()))}},
                         packed);
      body += Ros1Record({{"op", "\4"}}, "index");
    }
    chunk.clear();
    num_in_chunk = 0;
  };
  for (const Recorded& message : messages) {
    const auto number = static_cast<uint32_t>(numbers.at(message.topic));
    if (!is_listed[static_cast<int>(number)]) {
      const std::string connection = Ros1Record(
          {{"op", "\7"}, {"conn", BytesOf(number)}, {"topic", message.topic}},
          Ros1Fields({{"topic", message.topic}, {"type", message.type}, {"message_definition", "a=b"}}));
      chunk += connection;
      connections += connection;
      is_listed[static_cast<int>(number)] = true;
    }
    const std::string time = BytesOf(static_cast<uint32_t>(message.time_ns / 1'000'000'000)) +
                             BytesOf(static_cast<uint32_t>(message.time_ns % 1'000'000'000));
    chunk += Ros1Record({{"op", "\2"}, {"conn", BytesOf(number)}, {"time", time}}, message.bytes);
    if (++num_in_chunk == form.messages_per_chunk) end_chunk();
  }
  end_chunk();
  const auto head = [&](uint64_t index_place) {
    return kFirstLine + Ros1Record({{"op", "\3"}, {"index_pos", BytesOf(index_place)}}, std::string(50, ' '));
  };
  if (!form.is_closed) return head(0) + body;
  return head(head(0).size() + body.size()) + body + connections + Ros1Record({{"op", "\6"}}, "chunk info");
}

}  // namespace cairn::pipeline
