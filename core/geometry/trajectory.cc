#include "core/geometry/trajectory.h"

#include <algorithm>
#include <iterator>

namespace cairn {

void Trajectory::Sort() {
  std::stable_sort(poses_.begin(), poses_.end(),
                   [](const TimedPose& a, const TimedPose& b) { return a.time_ns < b.time_ns; });
}

Result<Pose> Trajectory::At(int64_t time_ns, double max_gap_s) const {
  const auto next = std::lower_bound(poses_.begin(), poses_.end(), time_ns,
                                     [](const TimedPose& pose, int64_t time) { return pose.time_ns < time; });
  if (next != poses_.end() && next->time_ns == time_ns) return next->pose;
  if (next == poses_.begin() || next == poses_.end()) {
    return MakeError(ErrorCode::kNoData, "no stated pose {} it", next == poses_.begin() ? "before" : "after");
  }
  const TimedPose& before = *std::prev(next);
  const double since_s = 1e-9 * static_cast<double>(time_ns - before.time_ns);
  const double until_s = 1e-9 * static_cast<double>(next->time_ns - time_ns);
  if (std::max(since_s, until_s) > max_gap_s) {
    return MakeError(ErrorCode::kNoData,
                     "the stated poses around it are {:.3f} s before and {:.3f} s after, farther than {:g} s "
                     "(--max-time-gap-s)",
                     since_s, until_s, max_gap_s);
  }
  const double ratio = since_s / (since_s + until_s);
  return Pose{before.pose.rotation.slerp(ratio, next->pose.rotation).normalized(),
              (1 - ratio) * before.pose.translation + ratio * next->pose.translation};
}

}  // namespace cairn
