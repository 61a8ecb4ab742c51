#include "ros/gravity.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace cairn {

Status Gravity::Add(double time_s, const Eigen::Vector3d& up_in_imu, double more_sigma_deg) {
  // An IMU of 1000 Hz for 4 s: of an image that took longer on its way nothing is known.
  constexpr size_t kMaxNumUps = 4000;
  if (!std::isfinite(time_s))
    return MakeError(ErrorCode::kInvalidArgument, "gravity at a time that is not finite");
  CAIRN_RETURN_IF_ERROR(CheckSensedUp({up_in_imu, sigma_deg_}));
  if (!ups_.empty() && time_s < ups_.back().time_s) ups_.clear();
  ups_.push_back({time_s, up_in_imu, more_sigma_deg});
  if (ups_.size() > kMaxNumUps) ups_.pop_front();
  return Ok();
}

std::optional<SensedUp> Gravity::At(double image_time_s) const {
  constexpr double kMaxApartS = 0.1;
  if (ups_.empty()) return std::nullopt;
  auto nearest = std::prev(ups_.end());
  if (image_time_s != 0) {
    const auto after = std::lower_bound(ups_.begin(), ups_.end(), image_time_s,
                                        [](const TimedUp& up, double time) { return up.time_s < time; });
    const auto apart = [&](auto up) { return std::abs(up->time_s - image_time_s); };
    if (after != ups_.end()) nearest = after;
    if (after != ups_.begin() && apart(std::prev(after)) < apart(nearest)) nearest = std::prev(after);
    if (apart(nearest) > kMaxApartS) return std::nullopt;
  }
  return SensedUp{camera_from_imu_ * nearest->up_in_imu, std::hypot(sigma_deg_, nearest->more_sigma_deg)};
}

}  // namespace cairn
