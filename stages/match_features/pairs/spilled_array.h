#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/files/temporary.h"

namespace cairn::match_features {

// Values that are added once and read in parts: those that memory has no room for are in a file without a
// name.
template <typename T>
class SpilledArray {
  static_assert(std::is_trivially_destructible_v<T>);  // its bytes are its value

 public:
  // About `max_num_bytes` are in memory; the file is made where `beside` is.
  SpilledArray(std::string beside, int64_t max_num_bytes)
      : max_num_(static_cast<size_t>(max_num_bytes) / sizeof(T)), file_(std::move(beside)) {}

  // Values that are added at once are read at once.
  void Append(std::span<const T> values) {
    if (recent_.size() + values.size() > max_num_) Spill();
    recent_.insert(recent_.end(), values.begin(), values.end());
  }
  uint64_t size() const { return num_spilled_ + recent_.size(); }
  // Whether the file could be written so far.
  const Status& status() const { return status_; }

  // The values from `begin` on that were added at once, on any thread.  REQUIRES: status() is ok.  Errors:
  // Io.
  Status Read(uint64_t begin, std::span<T> values) const {
    if (begin < num_spilled_) return file_.Read(begin * sizeof(T), values.data(), values.size_bytes());
    std::copy_n(recent_.begin() + static_cast<ptrdiff_t>(begin - num_spilled_), values.size(),
                values.begin());
    return Ok();
  }

 private:
  void Spill() {
    if (status_.ok() && !recent_.empty()) status_ = file_.Append(recent_.data(), recent_.size() * sizeof(T));
    num_spilled_ += recent_.size();
    recent_.clear();
  }

  size_t max_num_;
  ScratchFile file_;
  uint64_t num_spilled_ = 0;
  std::vector<T> recent_;
  Status status_;
};

}  // namespace cairn::match_features
