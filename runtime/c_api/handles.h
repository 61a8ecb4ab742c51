#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>

namespace cairn {

// How many kinds of handles there are, and the number of each, which differ modulo that.
inline constexpr uint64_t kNumHandleKinds = 14;
enum class HandleKind : uint64_t {
  kMap = 1,
  kLocalizer = 2,
  kTracker = 3,
  kVisualTracker = 4,
  kLog = 5,
  kPlaceModel = 6,
  kStartHypotheses = 7,
  kPlaceBelief = 8,
  kAtlas = 9,
  kAtlasLocalizer = 10,
  kServo = 11,
  kPlan = 12,
  kScanLocator = 13,
  kPlanTracker = 14
};

// Handles that another language holds: `Handle` is an opaque C type, never defined.  A handle is a number
// that is given out once, not an address: a closed handle is recognised as closed, even when its memory is
// used again, and no pointer from a caller is ever followed.  Kinds differ in their residue modulo
// kNumHandleKinds, so that a handle of another kind is recognised too.  May be used from all threads; an
// object lives until the last user that got it from Find releases it.
template <typename Handle, typename Object, HandleKind kKind>
class Handles {
 public:
  Handle* Add(std::shared_ptr<Object> object) {
    const std::lock_guard lock(mutex_);
    next_ += kNumHandleKinds;
    objects_.emplace(next_, std::move(object));
    return reinterpret_cast<Handle*>(static_cast<uintptr_t>(next_));
  }
  // Null where the handle is not one of these, or was removed.
  std::shared_ptr<Object> Find(const Handle* handle) const {
    const std::lock_guard lock(mutex_);
    const auto found = objects_.find(Number(handle));
    return found == objects_.end() ? nullptr : found->second;
  }
  bool Remove(const Handle* handle) {
    std::shared_ptr<Object> removed;  // destroyed after the lock is given back
    const std::lock_guard lock(mutex_);
    const auto found = objects_.find(Number(handle));
    if (found == objects_.end()) return false;
    removed = std::move(found->second);
    objects_.erase(found);
    return true;
  }

 private:
  static uint64_t Number(const Handle* handle) { return reinterpret_cast<uintptr_t>(handle); }

  mutable std::mutex mutex_;
  uint64_t next_ = static_cast<uint64_t>(kKind);
  std::unordered_map<uint64_t, std::shared_ptr<Object>> objects_;
};

}  // namespace cairn
