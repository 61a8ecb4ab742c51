#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/base/error.h"

namespace cairn::pipeline {

// Reads numbers and runs of bytes from the front of a text, and never beyond its end: what is not there is
// zero or empty, and is_ok() says so from then on.
class ByteCursor {
 public:
  explicit ByteCursor(std::string_view bytes) : bytes_(bytes) {}

  bool is_ok() const { return is_ok_; }
  size_t place() const { return place_; }
  size_t num_left() const { return bytes_.size() - place_; }

  std::string_view Take(uint64_t num_bytes) {
    if (num_bytes > num_left()) {
      is_ok_ = false;
      place_ = bytes_.size();
      return {};
    }
    place_ += num_bytes;
    return bytes_.substr(place_ - num_bytes, num_bytes);
  }

  // Little-endian, or with its bytes the other way round.
  template <class T>
  T Get(bool is_big_endian = false) {
    static_assert(std::is_arithmetic_v<T>);
    const std::string_view taken = Take(sizeof(T));
    if (taken.empty()) return 0;
    char bytes[sizeof(T)];
    std::copy(taken.begin(), taken.end(), bytes);
    if (is_big_endian) std::reverse(bytes, bytes + sizeof(T));
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return value;
  }

 private:
  std::string_view bytes_;
  size_t place_ = 0;
  bool is_ok_ = true;
};

// A file of which parts are read.
class BagBytes {
 public:
  // Errors: as CheckInputFile, Io.
  static Result<BagBytes> Open(const std::string& path);
  const std::string& path() const { return path_; }
  uint64_t num_bytes() const { return num_bytes_; }
  // REQUIRES: the part lies in the file: nothing is allocated for what cannot be there.  Errors: Io.
  Result<std::string> At(uint64_t place, uint64_t length);

 private:
  std::string path_;
  std::ifstream file_;
  uint64_t num_bytes_ = 0;
};

// What was passed over for one reason: how often, and the first of it.
struct PassedOver {
  int64_t count = 0;
  std::string first;
  void Add(const std::string& reason) {
    if (count++ == 0) first = reason;
  }
};

// What a reading of a file found damaged.
struct BagDamage {
  PassedOver chunks, records;
  bool is_cut = false;  // at `place` is less than its length says
  uint64_t place = 0;
  bool is_closed = true;  // the recorder came to write the end
  std::vector<std::string> Sentences(const BagBytes& file) const;
};

}  // namespace cairn::pipeline
