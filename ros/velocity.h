#pragma once

#include <mutex>

#include <ros/callback_queue.h>
#include <ros/ros.h>

namespace cairn_ros {

// cmd_vel of a robot that is steered.  A command that no other one follows ends after a time: a thread of its
// own stops the robot, however long the node is busy with an image.
class Velocity {
 public:
  explicit Velocity(double stop_after_s);

  void Drive(double speed_m_s, double turn_rad_s);
  // Says so once.
  void Stop();

 private:
  void Watch(const ros::WallTimerEvent&);
  void Publish(double speed_m_s, double turn_rad_s);

  const double stop_after_s_;
  ros::Publisher commands_;
  std::mutex mutex_;  // of what follows, and of the order of messages
  bool is_moving_ = false;
  ros::WallTime last_;
  ros::CallbackQueue queue_;
  ros::WallTimer timer_;
  ros::AsyncSpinner spinner_{1, &queue_};  // last: it ends before what it calls
};

}  // namespace cairn_ros
