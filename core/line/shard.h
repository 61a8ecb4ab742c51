#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "core/base/error.h"

namespace cairn {

// One of several runs, on one or many machines, that share a stage's work: the index-th of `count`.
struct Shard {
  int index = 1;  // in [1, count]
  int count = 1;
};

// "3/64".  Errors: InvalidArgument.
Result<Shard> ParseShard(const std::string& text);

// The shard's items of `num_items`: [first, second).  The shares of all shards are contiguous and ascending,
// differ in size by at most one item, and together are all items.
std::pair<int64_t, int64_t> ShareOf(const Shard& shard, int64_t num_items);

}  // namespace cairn
