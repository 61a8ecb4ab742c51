#include "runtime/map/block_cache.h"

#include <new>
#include <utility>

#include "core/line/memory.h"

namespace cairn {
namespace {

// What is dropped leaves holes in the C library's memory, which it keeps: they are given back whenever so
// much was dropped.
constexpr int64_t kDroppedBytes = int64_t{8} << 20;

}  // namespace

std::shared_ptr<const void> BlockCache::Find(int64_t key) {
  const std::lock_guard lock(mutex_);
  const auto found = index_.find(key);
  if (found == index_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found->second);
  return found->second->block;
}

std::shared_ptr<const void> BlockCache::Insert(int64_t key, std::shared_ptr<const void> block,
                                               int64_t num_bytes) {
  std::unique_lock lock(mutex_);
  if (const auto found = index_.find(key); found != index_.end()) return found->second->block;
  entries_.push_front({key, std::move(block), num_bytes});
  try {
    index_[key] = entries_.begin();
  } catch (const std::bad_alloc&) {
    entries_.pop_front();
    throw;
  }
  num_bytes_ += num_bytes;
  ++num_loads_;
  std::shared_ptr<const void> inserted = entries_.front().block;
  while (num_bytes_ > budget_bytes_ && !entries_.empty()) {
    num_bytes_ -= entries_.back().num_bytes;
    if (entries_.back().block.use_count() == 1) num_dropped_bytes_ += entries_.back().num_bytes;
    index_.erase(entries_.back().key);
    entries_.pop_back();
  }
  if (num_dropped_bytes_ >= kDroppedBytes) {
    num_dropped_bytes_ = 0;
    lock.unlock();
    ReturnFreedMemory();
  }
  return inserted;
}

int64_t BlockCache::num_bytes() const {
  const std::lock_guard lock(mutex_);
  return num_bytes_;
}

int64_t BlockCache::num_blocks() const {
  const std::lock_guard lock(mutex_);
  return static_cast<int64_t>(entries_.size());
}

int64_t BlockCache::num_loads() const {
  const std::lock_guard lock(mutex_);
  return num_loads_;
}

}  // namespace cairn
