// ROS 1's bags (http://wiki.ros.org/Bags/Format/2.0): a first line, then records of a head (fields
// NAME=VALUE) and contents, each with its length before it, little-endian.  Messages and their connections,
// which name topic and type, stand in chunks, which may be compressed; connections stand once more at the
// end.  Read from front to back, so that a file that was cut off gives what is whole.
#include <algorithm>
#include <map>
#include <optional>

#include "pipeline/exchange/bags/files/bag.h"
#include "pipeline/exchange/bags/files/bag_bytes.h"
#include "pipeline/exchange/bags/files/chunk_compression.h"

namespace cairn::pipeline {
namespace {

constexpr std::string_view kFirstLine = "#ROSBAG V2.0\n";
constexpr uint64_t kLengthBytes = 4;

enum Ros1Op : uint8_t {
  kRos1Message = 2,
  kRos1BagHead = 3,
  kRos1Chunk = 5,
  kRos1Connection = 7,
};

// NAME=VALUE, each with its length before it.
class HeadFields {
 public:
  explicit HeadFields(std::string_view head) {
    ByteCursor cursor(head);
    while (cursor.num_left() > 0 && cursor.is_ok()) {
      const std::string_view field = cursor.Take(cursor.Get<uint32_t>());
      const size_t middle = field.find('=');
      if (middle != std::string_view::npos)
        fields_.emplace(field.substr(0, middle), field.substr(middle + 1));
    }
  }
  std::string Text(std::string_view name) const {
    const auto field = fields_.find(name);
    return field == fields_.end() ? std::string() : std::string(field->second);
  }
  // Nothing where the field is missing or of another length.
  template <class T>
  std::optional<T> Number(std::string_view name) const {
    const auto field = fields_.find(name);
    if (field == fields_.end() || field->second.size() != sizeof(T)) return std::nullopt;
    return ByteCursor(field->second).Get<T>();
  }

 private:
  std::map<std::string_view, std::string_view> fields_;
};

class Ros1Bag : public Bag {
 public:
  explicit Ros1Bag(BagBytes file) : file_(std::move(file)) {}

  // Connections stand before their messages; where that chunk is damaged, they are found at the end.
  Status ReadIndex() {
    uint64_t place = kFirstLine.size();
    CAIRN_ASSIGN_OR_RETURN(const std::optional<Record> first, RecordAt(place));
    if (!first) return Ok();
    const HeadFields bag_head(first->head);
    if (const std::string encryptor = bag_head.Text("encryptor"); !encryptor.empty()) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: is encrypted by {}; 'rosbag decrypt' makes one that can be read", file_.path(),
                       encryptor);
    }
    // 0 until the recorder ends.
    place = bag_head.Number<uint64_t>("index_pos").value_or(0);
    is_closed_ = place > 0 && place <= file_.num_bytes();
    while (is_closed_) {
      CAIRN_ASSIGN_OR_RETURN(const std::optional<Record> record, RecordAt(place));
      if (!record) break;
      const HeadFields fields(record->head);
      if (fields.Number<uint8_t>("op") != kRos1Connection) break;
      CAIRN_ASSIGN_OR_RETURN(const std::string contents, file_.At(record->place, record->length));
      Learn(fields, contents);
      place = record->place + record->length;
    }
    return Ok();
  }

  Result<std::vector<std::string>> Read(BagVisitor& visitor) override {
    damage_ = {.is_closed = is_closed_};
    uint64_t& place = damage_.place = kFirstLine.size();
    while (place < file_.num_bytes()) {
      CAIRN_ASSIGN_OR_RETURN(const std::optional<Record> record, RecordAt(place));
      damage_.is_cut = !record;
      if (!record) break;
      const HeadFields fields(record->head);
      const std::string where = fmt::format("at byte {}", place);
      const auto op = fields.Number<uint8_t>("op");
      if (op == kRos1Chunk || op == kRos1Connection || op == kRos1Message) {
        CAIRN_ASSIGN_OR_RETURN(const std::string contents, file_.At(record->place, record->length));
        CAIRN_RETURN_IF_ERROR(op == kRos1Chunk ? ReadChunk(fields, contents, where, visitor)
                                               : ReadSmall(*op, fields, contents, where, visitor));
      } else if (!op) {
        damage_.records.Add(where);
      }
      place = record->place + record->length;
    }
    return damage_.Sentences(file_);
  }

 private:
  struct Record {
    std::string head;
    uint64_t place = 0;   // of its contents
    uint64_t length = 0;  // of its contents
  };

  // The record at a place, without its contents; none where it does not lie in the file.
  Result<std::optional<Record>> RecordAt(uint64_t place) {
    Record record;
    CAIRN_ASSIGN_OR_RETURN(const std::optional<uint32_t> head_length, LengthAt(place));
    if (!head_length) return std::optional<Record>();
    place += kLengthBytes;
    CAIRN_ASSIGN_OR_RETURN(record.head, file_.At(place, *head_length));
    CAIRN_ASSIGN_OR_RETURN(const std::optional<uint32_t> length, LengthAt(place + *head_length));
    if (!length) return std::optional<Record>();
    record.place = place + *head_length + kLengthBytes;
    record.length = *length;
    return std::optional<Record>(std::move(record));
  }

  // A length and as many bytes as it says lie in the file, or there is none.
  Result<std::optional<uint32_t>> LengthAt(uint64_t place) {
    if (place > file_.num_bytes() || file_.num_bytes() - place < kLengthBytes)
      return std::optional<uint32_t>();
    CAIRN_ASSIGN_OR_RETURN(const std::string bytes, file_.At(place, kLengthBytes));
    const auto length = ByteCursor(bytes).Get<uint32_t>();
    if (length > file_.num_bytes() - place - kLengthBytes) return std::optional<uint32_t>();
    return std::optional<uint32_t>(length);
  }

  Status ReadChunk(const HeadFields& fields, std::string_view packed, const std::string& where,
                   BagVisitor& visitor) {
    const Result<std::string> records =
        UnpackChunk(fields.Text("compression"), packed, fields.Number<uint32_t>("size").value_or(0));
    if (!records.ok()) {
      damage_.chunks.Add(where + ": " + records.error().message);
      return Ok();
    }
    ByteCursor cursor(*records);
    while (cursor.num_left() > 0) {
      const HeadFields head(cursor.Take(cursor.Get<uint32_t>()));
      const std::string_view contents = cursor.Take(cursor.Get<uint32_t>());
      const auto op = head.Number<uint8_t>("op");
      if (!cursor.is_ok() || !op) {
        damage_.records.Add(where + ", in the chunk");
        break;
      }
      CAIRN_RETURN_IF_ERROR(ReadSmall(*op, head, contents, where, visitor));
    }
    return Ok();
  }

  Status ReadSmall(uint8_t op, const HeadFields& fields, std::string_view contents, const std::string& where,
                   BagVisitor& visitor) {
    if (op == kRos1Connection && !Learn(fields, contents)) damage_.records.Add(where);
    if (op != kRos1Message) return Ok();
    const auto connection = connections_.find(fields.Number<uint32_t>("conn").value_or(~0u));
    const auto time = fields.Number<uint64_t>("time");
    if (connection == connections_.end() || !time) {
      damage_.records.Add(where);
      return Ok();
    }
    // Seconds, then nanoseconds.
    const auto time_ns = static_cast<int64_t>((*time & 0xffffffff) * 1'000'000'000 + (*time >> 32));
    if (!visitor.Wants(connection->second, time_ns)) return Ok();
    return visitor.Take({connection->second, time_ns, contents});
  }

  bool Learn(const HeadFields& fields, std::string_view contents) {
    const auto number = fields.Number<uint32_t>("conn");
    const std::string type = HeadFields(contents).Text("type");
    if (!number || type.empty()) return false;
    connections_.emplace(*number, BagTopic{fields.Text("topic"), type, Serialization::kRos1});
    return true;
  }

  BagBytes file_;
  bool is_closed_ = false;
  std::map<uint32_t, BagTopic> connections_;
  BagDamage damage_;
};

}  // namespace

Result<std::unique_ptr<Bag>> OpenRos1Bag(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(BagBytes file, BagBytes::Open(path));
  const uint64_t num_bytes = std::min<uint64_t>(kFirstLine.size(), file.num_bytes());
  CAIRN_ASSIGN_OR_RETURN(const std::string head, file.At(0, num_bytes));
  if (head != kFirstLine) {
    return MakeError(ErrorCode::kUnsupported,
                     "{}: a bag of another version of ROS 1 than 2.0; 'rosbag fix' makes it one", path);
  }
  auto bag = std::make_unique<Ros1Bag>(std::move(file));
  CAIRN_RETURN_IF_ERROR(bag->ReadIndex());
  return std::unique_ptr<Bag>(std::move(bag));
}

}  // namespace cairn::pipeline
