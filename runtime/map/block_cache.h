#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>

namespace cairn {

// The loaded parts of a map, within a budget of bytes: the least recently used is dropped first.  A block
// that somebody still holds stays alive until it is released.  What many dropped blocks took is given back to
// the system.  May be used by several threads at once.
class BlockCache {
 public:
  explicit BlockCache(int64_t budget_bytes) : budget_bytes_(budget_bytes) {}

  // Null when it is not loaded.
  std::shared_ptr<const void> Find(int64_t key);
  // Returns the block kept under this key: another thread may have inserted one first.
  std::shared_ptr<const void> Insert(int64_t key, std::shared_ptr<const void> block, int64_t num_bytes);

  int64_t num_bytes() const;
  int64_t num_blocks() const;
  // Number of blocks inserted so far.
  int64_t num_loads() const;

 private:
  struct Entry {
    int64_t key = 0;
    std::shared_ptr<const void> block;
    int64_t num_bytes = 0;
  };

  const int64_t budget_bytes_;
  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // most recently used first
  std::unordered_map<int64_t, std::list<Entry>::iterator> index_;
  int64_t num_bytes_ = 0;
  int64_t num_dropped_bytes_ = 0;  // since freed memory was given back
  int64_t num_loads_ = 0;
};

}  // namespace cairn
