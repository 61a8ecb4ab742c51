#include "core/line/shard.h"

#include <algorithm>
#include <charconv>
#include <string_view>

namespace cairn {
namespace {

bool ParseCount(std::string_view text, int* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

Result<Shard> ParseShard(const std::string& text) {
  Shard shard;
  const std::string_view view = text;
  const size_t slash = view.find('/');
  if (slash == std::string_view::npos || !ParseCount(view.substr(0, slash), &shard.index) ||
      !ParseCount(view.substr(slash + 1), &shard.count) || shard.index < 1 || shard.index > shard.count) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "shard '{}': expected I/N, the I-th of N runs, with 1 <= I <= N (for example 3/64)",
                     text);
  }
  return shard;
}

std::pair<int64_t, int64_t> ShareOf(const Shard& shard, int64_t num_items) {
  const int64_t size = num_items / shard.count, num_larger = num_items % shard.count;
  const auto begin = [&](int64_t i) { return i * size + std::min(i, num_larger); };
  return {begin(shard.index - 1), begin(shard.index)};
}

}  // namespace cairn
