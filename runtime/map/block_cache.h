#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>

namespace cairn {

// What was loaded of a map, within a budget of bytes: the least recently used goes first.  What somebody
// still holds stays alive until he lets go.  May be used by several threads at once.
class BlockCache {
 public:
  explicit BlockCache(int64_t budget_bytes) : budget_bytes_(budget_bytes) {}

  // Null when it is not there.
  std::shared_ptr<const void> Find(int64_t key);
  // Returns what is kept under this key: another thread may have been faster.
  std::shared_ptr<const void> Insert(int64_t key, std::shared_ptr<const void> block, int64_t num_bytes);

  int64_t num_bytes() const;
  int64_t num_blocks() const;
  // Blocks inserted since the beginning.
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
  int64_t num_loads_ = 0;
};

}  // namespace cairn
