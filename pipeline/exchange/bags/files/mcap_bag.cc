// MCAP, version 0 (https://mcap.dev/spec): magic, then records of an opcode (1 byte), a length (8) and their
// contents, little-endian; messages stand in chunks, which may be compressed.  Read from front to back, so
// that a file that was cut off gives what is whole; of the index at the end only channels are used.
#include <algorithm>
#include <map>

#include <zlib.h>

#include "pipeline/exchange/bags/files/bag.h"
#include "pipeline/exchange/bags/files/bag_bytes.h"
#include "pipeline/exchange/bags/files/chunk_compression.h"

namespace cairn::pipeline {
namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
constexpr uint64_t kRecordHeadBytes = 9;
constexpr uint64_t kFooterBytes = 20;
// Messages and chunks that are longer are refused.
constexpr uint64_t kMaxRecordBytes = 1 << 30;

enum Opcode : uint8_t {
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kDataEnd = 15,
};

class McapBag : public Bag {
 public:
  explicit McapBag(BagBytes file) : file_(std::move(file)), num_bytes_(file_.num_bytes()) {}

  // Channels stand before their messages; where that chunk is damaged, they are found in the summary.
  Status ReadSummary() {
    const uint64_t tail = kRecordHeadBytes + kFooterBytes + kMagic.size();
    if (num_bytes_ < kMagic.size() + tail) return Ok();
    CAIRN_ASSIGN_OR_RETURN(const std::string end, file_.At(num_bytes_ - tail, tail));
    is_closed_ = end.ends_with(kMagic) && end[0] == kFooter;
    if (!is_closed_) return Ok();
    ByteCursor footer(std::string_view(end).substr(kRecordHeadBytes));
    const uint64_t start = footer.Get<uint64_t>();
    if (start < kMagic.size() || start > num_bytes_ - tail || num_bytes_ - tail - start > kMaxRecordBytes)
      return Ok();
    CAIRN_ASSIGN_OR_RETURN(const std::string summary, file_.At(start, num_bytes_ - tail - start));
    ByteCursor records(summary);
    while (records.num_left() >= kRecordHeadBytes) {
      const auto opcode = records.Get<uint8_t>();
      const std::string_view record = records.Take(records.Get<uint64_t>());
      if (!records.is_ok()) break;
      if (opcode == kSchema || opcode == kChannel) Learn(opcode, record);
    }
    return Ok();
  }

  Result<std::vector<std::string>> Read(BagVisitor& visitor) override {
    damage_ = {.is_closed = is_closed_};
    uint64_t& place = damage_.place = kMagic.size();
    for (bool is_end = false; !is_end && place < num_bytes_;) {
      if (num_bytes_ - place < kRecordHeadBytes) {
        damage_.is_cut = true;
        break;
      }
      const Result<std::string> head = file_.At(place, kRecordHeadBytes);
      if (!head.ok()) return head.error();
      ByteCursor cursor(*head);
      const auto opcode = cursor.Get<uint8_t>();
      const auto length = cursor.Get<uint64_t>();
      if (length > num_bytes_ - place - kRecordHeadBytes) {
        damage_.is_cut = true;
        break;
      }
      is_end = opcode == kDataEnd || opcode == kFooter;
      CAIRN_RETURN_IF_ERROR(ReadRecord(opcode, place, length, visitor));
      place += kRecordHeadBytes + length;
    }
    return damage_.Sentences(file_);
  }

 private:
  Status ReadRecord(uint8_t opcode, uint64_t place, uint64_t length, BagVisitor& visitor) {
    if (opcode != kSchema && opcode != kChannel && opcode != kMessage && opcode != kChunk) return Ok();
    const std::string where = fmt::format("at byte {}", place);
    if (length > kMaxRecordBytes) {
      damage_.records.Add(where + ", which says to be longer than 1 GiB");
      return Ok();
    }
    CAIRN_ASSIGN_OR_RETURN(const std::string record, file_.At(place + kRecordHeadBytes, length));
    if (opcode == kChunk) return ReadChunk(record, where, visitor);
    if (opcode == kMessage) return Show(record, where, visitor);
    if (!Learn(opcode, record)) damage_.records.Add(where);
    return Ok();
  }

  Status ReadChunk(std::string_view chunk, const std::string& where, BagVisitor& visitor) {
    ByteCursor cursor(chunk);
    cursor.Take(16);  // times of its first and last message
    const auto num_bytes = cursor.Get<uint64_t>();
    const auto crc = cursor.Get<uint32_t>();
    const std::string compression(cursor.Take(cursor.Get<uint32_t>()));
    const std::string_view packed = cursor.Take(cursor.Get<uint64_t>());
    if (!cursor.is_ok()) {
      damage_.chunks.Add(where + ": lengths in it that are not those of the chunk");
      return Ok();
    }
    const Result<std::string> records = UnpackChunk(compression, packed, num_bytes);
    if (!records.ok()) {
      damage_.chunks.Add(where + ": " + records.error().message);
      return Ok();
    }
    const auto found = static_cast<uint32_t>(
        crc32_z(0, reinterpret_cast<const unsigned char*>(records->data()), records->size()));
    if (crc != 0 && crc != found) {  // 0: not computed
      damage_.chunks.Add(fmt::format("{}: its checksum is {:08x}, stated is {:08x}", where, found, crc));
      return Ok();
    }
    return ReadRecordsOfChunk(*records, where, visitor);
  }

  Status ReadRecordsOfChunk(std::string_view records, const std::string& where, BagVisitor& visitor) {
    ByteCursor cursor(records);
    while (cursor.num_left() > 0) {
      const auto opcode = cursor.Get<uint8_t>();
      const std::string_view record = cursor.Take(cursor.Get<uint64_t>());
      if (!cursor.is_ok()) {
        damage_.records.Add(where + ", in the chunk");
        break;
      }
      if (opcode == kMessage) CAIRN_RETURN_IF_ERROR(Show(record, where, visitor));
      if ((opcode == kSchema || opcode == kChannel) && !Learn(opcode, record))
        damage_.records.Add(where + ", in the chunk");
    }
    return Ok();
  }

  Status Show(std::string_view record, const std::string& where, BagVisitor& visitor) {
    ByteCursor cursor(record);
    const auto channel_id = cursor.Get<uint16_t>();
    cursor.Get<uint32_t>();  // sequence
    const auto log_time = cursor.Get<uint64_t>();
    cursor.Get<uint64_t>();  // publish time
    const auto channel = channels_.find(channel_id);
    if (!cursor.is_ok() || channel == channels_.end()) {
      damage_.records.Add(where);
      return Ok();
    }
    const auto time_ns = static_cast<int64_t>(log_time);
    if (!visitor.Wants(channel->second, time_ns)) return Ok();
    return visitor.Take({channel->second, time_ns, cursor.Take(cursor.num_left())});
  }

  // Keeps a schema's name, or a channel.  The first of a number counts, which later ones repeat.
  bool Learn(uint8_t opcode, std::string_view record) {
    ByteCursor cursor(record);
    const auto id = cursor.Get<uint16_t>();
    if (opcode == kSchema) {
      const std::string name(cursor.Take(cursor.Get<uint32_t>()));
      if (cursor.is_ok()) schemas_.emplace(id, name);
      return cursor.is_ok();
    }
    const auto schema_id = cursor.Get<uint16_t>();
    const std::string topic(cursor.Take(cursor.Get<uint32_t>()));
    const std::string encoding(cursor.Take(cursor.Get<uint32_t>()));
    if (!cursor.is_ok()) return false;
    const auto schema = schemas_.find(schema_id);
    const std::string type = schema == schemas_.end() ? "" : TypeWithoutMsg(schema->second);
    channels_.emplace(id, BagTopic{topic, type,
                                   encoding == "cdr"    ? Serialization::kCdr
                                   : encoding == "ros1" ? Serialization::kRos1
                                                        : Serialization::kUnknown});
    return true;
  }

  BagBytes file_;
  uint64_t num_bytes_;
  bool is_closed_ = false;
  std::map<uint16_t, std::string> schemas_;
  std::map<uint16_t, BagTopic> channels_;
  BagDamage damage_;
};

}  // namespace

Result<std::unique_ptr<Bag>> OpenMcapBag(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(BagBytes file, BagBytes::Open(path));
  CAIRN_ASSIGN_OR_RETURN(const std::string head,
                         file.At(0, std::min<uint64_t>(kMagic.size(), file.num_bytes())));
  if (head != kMagic) {
    return MakeError(ErrorCode::kCorrupt, "{}: does not begin as MCAP, version 0, does; is it truncated?",
                     path);
  }
  auto bag = std::make_unique<McapBag>(std::move(file));
  CAIRN_RETURN_IF_ERROR(bag->ReadSummary());
  return std::unique_ptr<Bag>(std::move(bag));
}

}  // namespace cairn::pipeline
