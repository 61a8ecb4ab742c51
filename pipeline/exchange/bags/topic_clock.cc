#include "pipeline/exchange/bags/topic_clock.h"

#include <cmath>
#include <cstdlib>
#include <limits>

#include <fmt/format.h>

namespace cairn::pipeline {
namespace {

// Stamps are wild where they are off by more than this, ns, and by this many times what is usual.
constexpr int64_t kWildNs = 10'000'000'000, kWildFactor = 10;
// Stamps of two sources are of one clock where, seen from the times at which they were recorded, they differ
// by less than this, ns: no driver and no network takes so long.
constexpr uint64_t kTwoClocksNs = 5'000'000'000;
// Times of recording say when something happened where they follow stamps as closely as this, ns.
constexpr int64_t kSteadyNs = 200'000'000;

int64_t MedianOf(std::vector<int64_t> values) {
  const auto middle = values.begin() + static_cast<int64_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Sums and differences of times as they stand in damaged messages, too.
int64_t Plus(int64_t a, int64_t b) {
  int64_t sum = 0;
  if (!__builtin_add_overflow(a, b, &sum)) return sum;
  return b < 0 ? std::numeric_limits<int64_t>::min() : std::numeric_limits<int64_t>::max();
}
int64_t Minus(int64_t a, int64_t b) {
  int64_t difference = 0;
  if (!__builtin_sub_overflow(a, b, &difference)) return difference;
  return a < b ? std::numeric_limits<int64_t>::min() : std::numeric_limits<int64_t>::max();
}
uint64_t Distance(int64_t a, int64_t b) {
  return a < b ? static_cast<uint64_t>(b) - static_cast<uint64_t>(a)
               : static_cast<uint64_t>(a) - static_cast<uint64_t>(b);
}

}  // namespace

std::string TimeSpan::Text() const {
  return fmt::format("{:.3f} to {:.3f} s", 1e-9 * static_cast<double>(first_ns),
                     1e-9 * static_cast<double>(last_ns));
}

void TopicClock::Add(int64_t stamp_ns, int64_t record_time_ns) {
  recorded_.Add(record_time_ns);
  if (stamp_ns != 0) aheads_ns_.push_back(Minus(stamp_ns, record_time_ns));
}

void TopicClock::Finish() {
  if (aheads_ns_.empty()) return;
  ahead_ns_ = MedianOf(aheads_ns_);
  std::vector<int64_t> distances;
  for (const int64_t ahead_ns : aheads_ns_) {
    distances.push_back(static_cast<int64_t>(std::min<uint64_t>(
        Distance(ahead_ns, ahead_ns_), static_cast<uint64_t>(std::numeric_limits<int64_t>::max()))));
  }
  spread_ns_ = MedianOf(std::move(distances));
  aheads_ns_ = {};
}

bool TopicClock::IsWild(int64_t stamp_ns, int64_t record_time_ns) const {
  if (stamp_ns == 0) return false;
  const uint64_t off_ns = Distance(Minus(stamp_ns, record_time_ns), ahead_ns_);
  return off_ns > kWildNs && off_ns / kWildFactor > static_cast<uint64_t>(spread_ns_);
}

int64_t TopicClock::TimeOf(int64_t stamp_ns, int64_t record_time_ns) const {
  if (stamp_ns != 0 && !IsWild(stamp_ns, record_time_ns)) return stamp_ns;
  int64_t time_ns = 0;
  if (__builtin_add_overflow(record_time_ns, ahead_ns_, &time_ns))
    return std::max<int64_t>(record_time_ns, 0);
  return std::max<int64_t>(time_ns, 0);
}

int64_t ShiftToClock(const TopicClock& clock, const TopicClock& other) {
  const bool is_one_clock = Distance(clock.ahead_ns(), other.ahead_ns()) < kTwoClocksNs;
  const bool is_steady = std::max(clock.spread_ns(), other.spread_ns()) <= kSteadyNs;
  if (is_one_clock || !is_steady || !clock.recorded().Meets(other.recorded())) return 0;
  return Minus(clock.ahead_ns(), other.ahead_ns());
}

int64_t SourceTimes::Take(int64_t stamp_ns, int64_t record_time_ns) {
  has_taken_ = true;
  if (stamp_ns == 0) unstamped_.Add("");
  if (clock_.IsWild(stamp_ns, record_time_ns))
    wild_.Add(fmt::format("{:.3f} s", 1e-9 * static_cast<double>(stamp_ns)));
  return Plus(clock_.TimeOf(stamp_ns, record_time_ns), shift_ns_);
}

std::vector<std::string> SourceTimes::Warnings(const std::string& things) const {
  std::vector<std::string> warnings;
  if (unstamped_.count > 0) {
    warnings.push_back(fmt::format("{} {} have no stamp; they have the times at which they were recorded",
                                   unstamped_.count, things));
  }
  if (wild_.count > 0) {
    warnings.push_back(fmt::format(
        "{} {} have stamps far from when they were recorded, unlike the others (the first: {}); they have "
        "the times at which they were recorded",
        wild_.count, things, wild_.first));
  }
  return warnings;
}

}  // namespace cairn::pipeline
