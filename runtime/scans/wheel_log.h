#pragma once

#include <optional>
#include <vector>

#include "core/geometry/planar_pose.h"

namespace cairn {

// Where a robot's wheels say that the scans of its log were taken.
class WheelLog {
 public:
  // The next message of the log.  One at time 0, after others that have a time, states a corrected pose, from
  // which the next ones go on: nothing moved.  Without a time it is as late as the one before.
  void AddOdometry(const PlanarPose& wheels, std::optional<double> time_s);
  // The next scan.  `pose`: the log's; `wheels`: what the scan's own message says of them, where it does.
  void AddScan(const PlanarPose& pose, const std::optional<PlanarPose>& wheels, double time_s);
  // The laser is so far ahead of the axle, metres.
  void SetLaserOffset(double metres) { laser_offset_m_ = metres; }

  // Of the laser at a scan, in a frame of the wheels': by the scans' own messages, where these differ from
  // their poses anywhere in the log; else by the messages before and after it; without any by the log's
  // poses.
  std::optional<PlanarPose> LaserAt(size_t scan) const;

 private:
  struct Message {
    PlanarPose wheels;
    double time_s = 0;
  };
  struct Scan {
    PlanarPose pose;
    std::optional<PlanarPose> wheels;
    double time_s = 0;
    size_t num_before = 0;  // messages
  };
  PlanarPose Between(const Scan& scan) const;

  std::vector<Message> messages_;
  PlanarPose last_told_;
  bool has_time_ = false;  // any message
  std::vector<Scan> scans_;
  bool told_by_scans_ = false;
  double laser_offset_m_ = 0;
};

}  // namespace cairn
