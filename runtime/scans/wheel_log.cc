#include "runtime/scans/wheel_log.h"

#include <algorithm>

namespace cairn {
void WheelLog::AddOdometry(const PlanarPose& wheels, std::optional<double> time_s) {
  const bool is_correction = has_time_ && time_s == 0;
  PlanarPose now = wheels;
  if (!messages_.empty()) {
    const PlanarPose& last = messages_.back().wheels;
    now = is_correction ? last : last * MotionBetween(last_told_, wheels);
  }
  last_told_ = wheels;
  const double before_s = messages_.empty() ? 0 : messages_.back().time_s;
  has_time_ = has_time_ || time_s.value_or(0) != 0;
  messages_.push_back({now, is_correction ? before_s : time_s.value_or(before_s)});
}

void WheelLog::AddScan(const PlanarPose& pose, const std::optional<PlanarPose>& wheels, double time_s) {
  scans_.push_back({pose, wheels, time_s, messages_.size()});
  if (wheels && (pose.position != wheels->position || pose.heading_rad != wheels->heading_rad))
    told_by_scans_ = true;
}

std::optional<PlanarPose> WheelLog::LaserAt(size_t scan) const {
  std::optional<PlanarPose> axle;
  if (told_by_scans_) {
    axle = scans_[scan].wheels;
  } else if (!messages_.empty()) {
    axle = Between(scans_[scan]);
  } else {
    return scans_[scan].pose;
  }
  if (axle) axle->position = axle->FloorFromRobot({laser_offset_m_, 0});
  return axle;
}

PlanarPose WheelLog::Between(const Scan& scan) const {
  if (scan.num_before == 0) return messages_.front().wheels;
  const Message& before = messages_[scan.num_before - 1];
  if (scan.num_before == messages_.size()) return before.wheels;
  const Message& after = messages_[scan.num_before];
  const double between_s = after.time_s - before.time_s;
  // Clocks of several computers may disagree.
  const double share = between_s > 0 ? std::clamp((scan.time_s - before.time_s) / between_s, 0.0, 1.0) : 0;
  return {before.wheels.position + share * (after.wheels.position - before.wheels.position),
          WrapAngle(before.wheels.heading_rad +
                    share * WrapAngle(after.wheels.heading_rad - before.wheels.heading_rad))};
}

}  // namespace cairn
