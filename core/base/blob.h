#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"

namespace cairn {

// Byte layouts of binary files and blobs: little-endian numbers and varints (7 bits a byte, lowest first, the
// top bit says that more follow).  schemas/FORMAT.md draws each blob of a map.
class BlobWriter {
 public:
  void Varint(uint64_t value);
  void UInt8(uint8_t value) { LittleEndian(value, 1); }
  void UInt32(uint32_t value) { LittleEndian(value, 4); }
  void UInt64(uint64_t value) { LittleEndian(value, 8); }
  void Float32(float value);
  void Float64(double value);
  void Bytes(const uint8_t* bytes, size_t num_bytes);
  void Bytes(std::string_view bytes) { bytes_.append(bytes); }
  // The text up to its first zero byte, and a zero byte.
  void ZeroTerminated(const std::string& text) { bytes_.append(text.c_str()).push_back('\0'); }
  size_t num_bytes() const { return bytes_.size(); }
  std::string Take() { return std::move(bytes_); }

 private:
  void LittleEndian(uint64_t bits, int num_bytes);

  std::string bytes_;
};

// Reads what BlobWriter wrote.  After a read past the end or of a varint that is too long, ok() is false and
// every value is 0: check once, at the end.
class BlobReader {
 public:
  explicit BlobReader(std::string_view bytes) : bytes_(bytes) {}

  uint64_t Varint() {
    // Most are short.
    if (ok_ && position_ < bytes_.size() && static_cast<uint8_t>(bytes_[position_]) < 0x80)
      return static_cast<uint8_t>(bytes_[position_++]);
    return LongVarint();
  }
  uint8_t UInt8() { return static_cast<uint8_t>(LittleEndian(1)); }
  uint32_t UInt32() { return static_cast<uint32_t>(LittleEndian(4)); }
  uint64_t UInt64() { return LittleEndian(8); }
  float Float32();
  double Float64();
  // The bytes before the next zero byte, which is read too.
  std::string ZeroTerminated();
  // The next bytes; empty past the end.
  std::string_view Bytes(size_t num_bytes);
  // Marks what was read as invalid: from now on every read fails, as past the end.
  void Fail() { ok_ = false; }
  size_t num_left() const { return bytes_.size() - position_; }
  bool ok() const { return ok_; }
  // Whether everything was read, without a failure.
  bool Finished() const { return ok_ && position_ == bytes_.size(); }

 private:
  uint64_t LongVarint();
  uint64_t LittleEndian(int num_bytes);

  std::string_view bytes_;
  size_t position_ = 0;
  bool ok_ = true;
};

// Strictly ascending numbers >= 0 as varints: the first plus 1, then each step from the one before (so a 0
// never occurs).
std::string EncodeAscending(const std::vector<int32_t>& values);
// Errors: Corrupt when the blob does not hold exactly `num_values` strictly ascending numbers in [0, limit).
Result<std::vector<int32_t>> DecodeAscending(std::string_view bytes, int64_t num_values, int64_t limit,
                                             const std::string& what);

}  // namespace cairn
