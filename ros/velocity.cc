#include "ros/velocity.h"

#include <geometry_msgs/Twist.h>

namespace cairn_ros {
namespace {

constexpr double kWatchPeriodS = 0.05;

}  // namespace

Velocity::Velocity(double stop_after_s) : stop_after_s_(stop_after_s) {
  ros::NodeHandle node;
  commands_ = node.advertise<geometry_msgs::Twist>("cmd_vel", 1);
  node.setCallbackQueue(&queue_);
  timer_ = node.createWallTimer(ros::WallDuration(kWatchPeriodS), &Velocity::Watch, this);
  spinner_.start();
}

void Velocity::Drive(double speed_m_s, double turn_rad_s) {
  const std::lock_guard<std::mutex> lock(mutex_);
  last_ = ros::WallTime::now();
  is_moving_ = speed_m_s != 0 || turn_rad_s != 0;
  Publish(speed_m_s, turn_rad_s);
}

void Velocity::Stop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!is_moving_) return;
  is_moving_ = false;
  Publish(0, 0);
}

void Velocity::Watch(const ros::WallTimerEvent&) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!is_moving_ || (ros::WallTime::now() - last_).toSec() < stop_after_s_) return;
  is_moving_ = false;
  ROS_WARN("no image for %g s: the robot stops", stop_after_s_);
  Publish(0, 0);
}

void Velocity::Publish(double speed_m_s, double turn_rad_s) {
  geometry_msgs::Twist message;
  message.linear.x = speed_m_s;
  message.angular.z = turn_rad_s;
  commands_.publish(message);
}

}  // namespace cairn_ros
