#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/pose.h"

namespace cairn {

// Poses at times, ascending.
class Trajectory {
 public:
  void Add(int64_t time_ns, const Pose& world_from_body) { poses_.push_back({time_ns, world_from_body}); }
  // To be called once, before At.
  void Sort();
  bool empty() const { return poses_.empty(); }
  // world_from_body at a time: the stated pose of that time, or between its two neighbours (translation
  // linear, rotation spherical) when both are within `max_gap_s`.  Errors: NoData, saying how far they are.
  Result<Pose> At(int64_t time_ns, double max_gap_s) const;

 private:
  struct TimedPose {
    int64_t time_ns;
    Pose pose;
  };
  std::vector<TimedPose> poses_;
};

}  // namespace cairn
