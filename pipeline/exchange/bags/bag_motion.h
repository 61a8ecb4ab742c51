#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/trajectory.h"
#include "pipeline/exchange/bags/bag_images.h"
#include "pipeline/exchange/bags/bag_options.h"
#include "pipeline/exchange/bags/bag_plan.h"
#include "pipeline/exchange/bags/frame_tree.h"
#include "pipeline/exchange/bags/topic_clock.h"

namespace cairn::pipeline {

// Collects what a bag says of how the robot moved: odometry, an IMU, and where frames are on each other.  All
// times are brought to the images' clock (ShiftToClock).
class MotionImporter {
 public:
  // `plan` and `options` outlive it.
  MotionImporter(const BagPlan& plan, const BagOptions& options);

  bool Wants(const BagTopic& topic) const;
  // A message that it wants.  What cannot be read is counted.
  void Take(const BagMessage& message);
  // After the last one, before what follows.
  void Finish();

  // odometry.txt's lines for the images that were written, how many they are, and in `warnings` what stands
  // in the way; "": nothing.
  std::string OdometryLines(const ImageImporter& images, int64_t* num_lines,
                            std::vector<std::string>* warnings) const;
  // imu.csv, likewise.
  std::string ImuLines(const ImageImporter& images, int64_t* num_lines,
                       std::vector<std::string>* warnings) const;
  std::vector<std::string> Warnings() const;  // without the bag's name

 private:
  void TakeOdometry(const BagMessage& message);
  void LookForJump(int64_t time_ns, const Eigen::Vector3d& place);
  void TakeImu(const BagMessage& message);
  void TakeTransforms(const BagMessage& message);
  int64_t TimeOf(const TransformMessage& transform, const BagMessage& message);
  std::vector<std::string> WarningsOfClocks() const;

  const BagPlan& plan_;
  const BagOptions& options_;
  FrameMotion motion_;
  Trajectory odometry_;
  SourceTimes odometry_times_;
  TimeSpan odometry_span_;
  std::optional<std::pair<int64_t, Eigen::Vector3d>> last_place_;  // of odometry, with its time
  std::vector<double> speeds_m_per_s_;                             // of odometry, between two messages
  FrameMotion imu_motion_;
  std::map<std::string, SourceTimes> frame_times_;  // of /tf, by child frame
  std::string imu_lines_;
  int64_t num_imu_samples_ = 0;
  SourceTimes imu_times_;
  TimeSpan imu_span_;
  PassedOver damaged_odometry_, jumps_, damaged_imu_, late_imu_, damaged_transforms_;
};

}  // namespace cairn::pipeline
