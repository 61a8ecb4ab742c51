#pragma once

#include <array>
#include <cassert>
#include <cstddef>

namespace cairn {

// A list of few elements, in place: no memory is asked for.
template <typename T, size_t MaxNum>
class ShortList {
 public:
  // REQUIRES: fewer than MaxNum
  void push_back(const T& value) {
    assert(num_ < MaxNum);
    values_[num_++] = value;
  }
  size_t size() const { return num_; }
  bool empty() const { return num_ == 0; }
  const T& operator[](size_t i) const { return values_[i]; }
  T* begin() { return values_.data(); }
  T* end() { return values_.data() + num_; }
  const T* begin() const { return values_.data(); }
  const T* end() const { return values_.data() + num_; }

 private:
  std::array<T, MaxNum> values_{};
  size_t num_ = 0;
};

}  // namespace cairn
