#include "core/base/blob.h"

#include <bit>

namespace cairn {

void BlobWriter::Varint(uint64_t value) {
  for (; value >= 0x80; value >>= 7) bytes_.push_back(static_cast<char>(value | 0x80));
  bytes_.push_back(static_cast<char>(value));
}

void BlobWriter::LittleEndian(uint64_t bits, int num_bytes) {
  for (int i = 0; i < num_bytes; ++i) bytes_.push_back(static_cast<char>(bits >> (8 * i)));
}

void BlobWriter::Float32(float value) { LittleEndian(std::bit_cast<uint32_t>(value), 4); }

void BlobWriter::Float64(double value) { LittleEndian(std::bit_cast<uint64_t>(value), 8); }

void BlobWriter::Bytes(const uint8_t* bytes, size_t num_bytes) {
  bytes_.append(reinterpret_cast<const char*>(bytes), num_bytes);
}

uint64_t BlobReader::LongVarint() {
  uint64_t value = 0;
  for (int shift = 0; ok_ && shift < 63; shift += 7) {
    if (position_ == bytes_.size()) break;
    const uint8_t byte = static_cast<uint8_t>(bytes_[position_++]);
    value |= static_cast<uint64_t>(byte & 0x7f) << shift;
    if (byte < 0x80) return value;
  }
  ok_ = false;
  return 0;
}

uint64_t BlobReader::LittleEndian(int num_bytes) {
  if (!ok_ || bytes_.size() - position_ < static_cast<size_t>(num_bytes)) {
    ok_ = false;
    return 0;
  }
  uint64_t bits = 0;
  for (int i = 0; i < num_bytes; ++i) {
    bits |= static_cast<uint64_t>(static_cast<uint8_t>(bytes_[position_++])) << (8 * i);
  }
  return bits;
}

float BlobReader::Float32() { return std::bit_cast<float>(static_cast<uint32_t>(LittleEndian(4))); }

double BlobReader::Float64() { return std::bit_cast<double>(LittleEndian(8)); }

std::string_view BlobReader::Bytes(size_t num_bytes) {
  if (!ok_ || bytes_.size() - position_ < num_bytes) {
    ok_ = false;
    return {};
  }
  position_ += num_bytes;
  return bytes_.substr(position_ - num_bytes, num_bytes);
}

std::string BlobReader::ZeroTerminated() {
  const size_t end = bytes_.find('\0', position_);
  if (!ok_ || end == std::string_view::npos) {
    ok_ = false;
    return "";
  }
  const std::string text(bytes_.substr(position_, end - position_));
  position_ = end + 1;
  return text;
}

std::string EncodeAscending(const std::vector<int32_t>& values) {
  BlobWriter writer;
  int32_t previous = -1;
  for (const int32_t value : values) {
    writer.Varint(static_cast<uint64_t>(static_cast<int64_t>(value) - previous));
    previous = value;
  }
  return writer.Take();
}

Result<std::vector<int32_t>> DecodeAscending(std::string_view bytes, int64_t num_values, int64_t limit,
                                             const std::string& what) {
  if (num_values < 0 ||
      num_values > static_cast<int64_t>(bytes.size())) {  // a varint takes at least one byte
    return MakeError(ErrorCode::kCorrupt, "{}: {} values in a blob of {} bytes", what, num_values,
                     bytes.size());
  }
  BlobReader reader(bytes);
  std::vector<int32_t> values(num_values);
  int64_t previous = -1;
  for (int32_t& value : values) {
    const uint64_t step = reader.Varint();
    if (step == 0 || step > static_cast<uint64_t>(limit) || previous + static_cast<int64_t>(step) >= limit) {
      return MakeError(ErrorCode::kCorrupt, "{}: not ascending numbers below {}", what, limit);
    }
    previous += static_cast<int64_t>(step);
    value = static_cast<int32_t>(previous);
  }
  if (!reader.Finished())
    return MakeError(ErrorCode::kCorrupt, "{}: bytes are left after {} values", what, num_values);
  return values;
}

}  // namespace cairn
