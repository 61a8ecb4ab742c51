#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <type_traits>

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

}  // namespace cairn::pipeline
