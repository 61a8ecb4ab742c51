// A ROS node that finds where a camera is in a cairn map: image in, pose out.  docs/ros.md describes its
// topics and parameters.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud.h>
#include <std_msgs/String.h>

#include "ros/map_localizer.h"
#include "ros/velocity.h"

namespace cairn_ros {
namespace {

using Diagnostic = diagnostic_msgs::DiagnosticStatus;
using std::chrono::steady_clock;

struct NodeParameters : Parameters {
  std::string map_frame = "map";
  double diagnostics_period_s = 1;  // 0: with every image
};

// Numbers separated by blanks, commas and brackets, as "[0.1, 0, 0.8]": roscpp takes lists from rosparam and
// launch files, but only texts from its command line.
bool ParseNumbers(const std::string& text, std::vector<double>* numbers) {
  static const char* const kBetween = " ,[]";
  for (size_t begin = text.find_first_not_of(kBetween); begin != std::string::npos;) {
    const size_t end = std::min(text.find_first_of(kBetween, begin), text.size());
    char* parsed = nullptr;
    const std::string word = text.substr(begin, end - begin);
    numbers->push_back(std::strtod(word.c_str(), &parsed));
    if (*parsed != 0) return false;
    begin = text.find_first_not_of(kBetween, end);
  }
  return true;
}

// Reads the node's parameters; a parameter that is set to another type is reported.
class ParameterReader {
 public:
  template <typename Value>
  void Read(const std::string& name, Value* value) {
    if (node_.hasParam(name) && !node_.getParam(name, *value)) wrong_ = name;
  }
  void Read(const std::string& name, std::vector<double>* numbers) {
    std::string text;
    if (!node_.hasParam(name) || node_.getParam(name, *numbers)) return;
    if (!node_.getParam(name, text) || !ParseNumbers(text, numbers)) wrong_ = name;
  }
  const std::string& wrong() const { return wrong_; }

 private:
  ros::NodeHandle node_{"~"};
  std::string wrong_;
};

// False: `wrong` is the name of one of another type.
bool ReadParameters(NodeParameters* p, std::string* wrong) {
  ParameterReader reader;
  reader.Read("map", &p->map);
  reader.Read("memory_budget_mib", &p->memory_budget_mib);
  reader.Read("public_key", &p->public_key);
  reader.Read("map_frame", &p->map_frame);
  reader.Read("follow", &p->follow);
  reader.Read("camera_in_robot", &p->camera_in_robot);
  reader.Read("gravity", &p->gravity);
  reader.Read("gravity_sigma_deg", &p->gravity_sigma_deg);
  reader.Read("imu_in_robot", &p->imu_in_robot);
  reader.Read("budget_ms", &p->budget_ms);
  reader.Read("core_speed", &p->core_speed);
  reader.Read("camera_model", &p->camera_model);
  reader.Read("camera_params", &p->camera_params);
  reader.Read("log", &p->log);
  reader.Read("log_max_mb_per_day", &p->log_max_mb_per_day);
  reader.Read("diagnostics_period_s", &p->diagnostics_period_s);
  reader.Read("steer", &p->steer);
  reader.Read("step_s", &p->step_s);
  reader.Read("max_speed_m_s", &p->max_speed_m_s);
  reader.Read("max_turn_deg_s", &p->max_turn_deg_s);
  reader.Read("stop_after_s", &p->stop_after_s);
  reader.Read("where", &p->where);
  reader.Read("where_period_s", &p->where_period_s);
  reader.Read("min_place_probability", &p->min_place_probability);
  reader.Read("plan", &p->plan);
  reader.Read("laser_in_robot", &p->laser_in_robot);
  reader.Read("laser_max_range_m", &p->laser_max_range_m);
  reader.Read("min_plan_probability", &p->min_plan_probability);
  *wrong = reader.wrong();
  return wrong->empty();
}

template <typename Number>
diagnostic_msgs::KeyValue KeyValue(const std::string& key, Number value) {
  diagnostic_msgs::KeyValue pair;
  pair.key = key;
  pair.value = std::to_string(value);
  return pair;
}

diagnostic_msgs::KeyValue KeyValue(const std::string& key, const std::string& value) {
  diagnostic_msgs::KeyValue pair;
  pair.key = key;
  pair.value = value;
  return pair;
}

geometry_msgs::Pose PoseMessage(const double (&position)[3], const double (&orientation_xyzw)[4]) {
  geometry_msgs::Pose pose;
  pose.position.x = position[0];
  pose.position.y = position[1];
  pose.position.z = position[2];
  pose.orientation.x = orientation_xyzw[0];
  pose.orientation.y = orientation_xyzw[1];
  pose.orientation.z = orientation_xyzw[2];
  pose.orientation.w = orientation_xyzw[3];
  return pose;
}

geometry_msgs::Point32 PointMessage(const double (&position)[3]) {
  geometry_msgs::Point32 point;
  point.x = static_cast<float>(position[0]);
  point.y = static_cast<float>(position[1]);
  point.z = static_cast<float>(position[2]);
  return point;
}

double HeadingOf(const geometry_msgs::Quaternion& q) {
  return std::atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z));
}

class LocalizerNode {
 public:
  LocalizerNode(NodeParameters parameters, MapLocalizer* localizer)
      : parameters_(std::move(parameters)), localizer_(localizer) {
    ros::NodeHandle node;
    poses_ = node.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 1);
    diagnostics_ = node.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 1);
    starts_ = node.advertise<sensor_msgs::PointCloud>("starts", 1, true);
    way_ = node.advertise<geometry_msgs::PoseArray>("way", 1, true);
    verdicts_ = node.advertise<std_msgs::String>("verdict", 10);
    next_ = node.advertise<std_msgs::String>("next", 1, true);
    if (parameters_.steer) velocity_ = std::make_unique<Velocity>(parameters_.stop_after_s);
    if (parameters_.where) places_ = node.advertise<sensor_msgs::PointCloud>("places", 1);
    if (localizer_->IsOnPlan()) {
      plan_poses_ = node.advertise<geometry_msgs::PoseWithCovarianceStamped>("plan_pose", 1);
      plan_places_ = node.advertise<geometry_msgs::PoseArray>("plan_places", 1);
      plan_beliefs_ = node.advertise<sensor_msgs::PointCloud>("plan_belief", 1);
      // Only the newest, as of images.
      scans_ = node.subscribe("scan", 1, &LocalizerNode::OnScan, this, ros::TransportHints().tcpNoDelay());
    }
    if (parameters_.where || parameters_.follow || localizer_->IsOnPlan())
      odometry_ = node.subscribe("odom", 1000, &LocalizerNode::OnOdometry, this);
    if (parameters_.gravity) imu_ = node.subscribe("imu", 1000, &LocalizerNode::OnImu, this);
    goals_ = node.subscribe("goal", 1, &LocalizerNode::OnGoal, this);
    progress_ = node.subscribe("progress", 10, &LocalizerNode::OnProgress, this);
    // Only the newest image: queued ones would be old.
    images_ = node.subscribe("image", 1, &LocalizerNode::OnImage, this, ros::TransportHints().tcpNoDelay());
  }

 private:
  void OnImage(const sensor_msgs::Image::ConstPtr& image) {
    const Image pixels = {image->encoding,
                          image->width,
                          image->height,
                          image->step,
                          image->data.data(),
                          image->data.size(),
                          image->header.stamp.toSec()};
    if (localizer_->IsLooking() && (image->header.stamp.isZero() || image->header.stamp >= asked_))
      PublishStarts(localizer_->Look(pixels), image->header.stamp);
    Steer(pixels, image->header.stamp);
    const steady_clock::time_point begin = steady_clock::now();
    const Answer answer = localizer_->Locate(pixels);
    ++num_images_;
    if (answer.has_fix) {
      ++num_fixes_;
      PublishPose(answer, image->header.stamp);
    }
    if (answer.places) PublishPlaces(*answer.places, image->header.stamp);
    if (answer.plan_places) PublishPlan(*answer.plan_places, image->header.stamp);
    const std::chrono::duration<double, std::milli> in_all = steady_clock::now() - begin;
    PublishDiagnostics(*image, answer, in_all.count());
  }

  // A command every step_s, as the servo expects; images that come sooner are for the pose alone.
  void Steer(const Image& pixels, const ros::Time& stamp) {
    if (!velocity_) return;
    if (!localizer_->IsSteering()) return velocity_->Stop();
    const double now_s = stamp.isZero() ? ros::Time::now().toSec() : stamp.toSec();
    if (std::abs(now_s - steered_s_) < 0.9 * parameters_.step_s) return;
    steered_s_ = now_s;
    const Steered steered = localizer_->Steer(pixels);
    velocity_->Drive(steered.speed_m_s, steered.turn_rad_s);
    for (const Starts& known : steered.arrivals) PublishStarts(known, stamp);
    if (!steered.error.empty()) ROS_ERROR_THROTTLE(10, "%s", steered.error.c_str());
    steering_ = steered.error.empty() ? steered.state : "error";
    steering_why_ = steered.error.empty() ? steered.why : steered.error;
  }

  void OnScan(const sensor_msgs::LaserScan::ConstPtr& scan) {
    const LaserScan turn = {scan->header.stamp.toSec(),
                            scan->angle_min,
                            scan->angle_increment,
                            scan->range_min,
                            scan->range_max,
                            scan->ranges.data(),
                            scan->ranges.size()};
    const std::optional<PlanPlaces> found = localizer_->Scan(turn);
    ++num_scans_;
    if (!found) {
      ROS_WARN_THROTTLE(60, "no odometry at a scan's time: it is located by itself, and not every one is");
      return;
    }
    PublishPlan(*found, scan->header.stamp);
    PublishPlanDiagnostics(*scan, *found);
  }

  void OnOdometry(const nav_msgs::Odometry::ConstPtr& message) {
    const geometry_msgs::Pose& pose = message->pose.pose;
    if (!localizer_->AddOdometry(message->header.stamp.toSec(), pose.position.x, pose.position.y,
                                 HeadingOf(pose.orientation)))
      ROS_ERROR_THROTTLE(10, "odometry that is not finite does not count");
  }

  // By its attitude; by its accelerations alone where it tells none (REP 145: covariance -1, or no
  // quaternion), and the robot neither speeds up nor brakes.
  void OnImu(const sensor_msgs::Imu::ConstPtr& message) {
    constexpr double kGravityMS2 = 9.81, kAtRestRatio = 0.03, kUnit = 0.01;
    const double stamp_s = message->header.stamp.toSec();
    const geometry_msgs::Quaternion& q = message->orientation;
    const double norm = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    bool is_taken = true;
    if (message->orientation_covariance[0] >= 0 && std::abs(norm - 1) < kUnit) {
      is_taken = localizer_->AddUp(stamp_s, 2 * (q.x * q.z - q.w * q.y), 2 * (q.y * q.z + q.w * q.x),
                                   1 - 2 * (q.x * q.x + q.y * q.y), false);
    } else {
      const geometry_msgs::Vector3& a = message->linear_acceleration;
      const double length = std::sqrt(a.x * a.x + a.y * a.y + a.z * a.z);
      if (std::abs(length / kGravityMS2 - 1) > kAtRestRatio) return;
      is_taken = localizer_->AddUp(stamp_s, a.x, a.y, a.z, true);
    }
    if (!is_taken) ROS_ERROR_THROTTLE(10, "an attitude that is not finite does not count");
  }

  // An image that was taken before does not count.
  void OnGoal(const std_msgs::String::ConstPtr& image) {
    asked_ = ros::Time::now();
    if (velocity_) velocity_->Stop();
    PublishStarts(localizer_->SetGoal(image->data), asked_);
  }

  void OnProgress(const std_msgs::String::ConstPtr& word) {
    asked_ = ros::Time::now();
    if (velocity_) velocity_->Stop();
    PublishStarts(localizer_->Report(word->data), asked_);
  }

  void PublishStarts(const Starts& found, const ros::Time& stamp) {
    if (!found.error.empty()) ROS_ERROR("%s", found.error.c_str());
    sensor_msgs::PointCloud starts;
    starts.header.stamp = stamp;
    starts.header.frame_id = parameters_.map_frame;
    starts.channels.resize(2);
    starts.channels[0].name = "posterior";
    starts.channels[1].name = "is_followed";
    for (size_t i = 0; i < found.starts.size(); ++i) {
      const Starts::Start& start = found.starts[i];
      starts.points.push_back(PointMessage(start.pose.position));
      starts.channels[0].values.push_back(static_cast<float>(start.posterior));
      starts.channels[1].values.push_back(static_cast<int>(i) == found.followed ? 1 : 0);
    }
    geometry_msgs::PoseArray way;
    way.header = starts.header;
    for (const SurveyPose& pose : found.way)
      way.poses.push_back(PoseMessage(pose.position, pose.orientation_xyzw));
    std_msgs::String verdict;
    verdict.data = found.error.empty() ? found.verdict : "error: " + found.error;
    starts_.publish(starts);
    way_.publish(way);
    verdicts_.publish(verdict);
    std_msgs::String next;
    next.data = found.next;
    next_.publish(next);
    next_name_ = found.next;
  }

  void PublishPlaces(const Places& found, const ros::Time& stamp) {
    if (!found.error.empty()) ROS_ERROR_THROTTLE(10, "%s", found.error.c_str());
    likely_place_ = found.places.empty() ? Places::Place() : found.places[0];
    elsewhere_ = found.elsewhere;
    if (!found.error.empty()) return;
    sensor_msgs::PointCloud places;
    places.header.stamp = stamp;
    places.header.frame_id = parameters_.map_frame;
    places.channels.resize(1);
    places.channels[0].name = "probability";
    for (const Places::Place& place : found.places) {
      places.points.push_back(PointMessage(place.pose.position));
      places.channels[0].values.push_back(static_cast<float>(place.probability));
    }
    places_.publish(places);
  }

  void PublishPlan(const PlanPlaces& found, const ros::Time& stamp) {
    if (!found.error.empty()) {
      ROS_ERROR_THROTTLE(10, "%s", found.error.c_str());
      return;
    }
    geometry_msgs::PoseArray places;
    places.header.stamp = stamp;
    places.header.frame_id = parameters_.map_frame;
    sensor_msgs::PointCloud belief;
    belief.header = places.header;
    belief.channels.resize(2);
    belief.channels[0].name = "probability";
    belief.channels[1].name = "is_determined";
    for (const PlanPlaces::Place& place : found.places) {
      places.poses.push_back(PoseMessage(place.position, place.orientation_xyzw));
      belief.points.push_back(PointMessage(place.position));
      belief.channels[0].values.push_back(static_cast<float>(place.probability));
      belief.channels[1].values.push_back(place.is_determined ? 1 : 0);
    }
    plan_places_.publish(places);
    plan_beliefs_.publish(belief);
    if (!IsSure(found)) return;
    geometry_msgs::PoseWithCovarianceStamped pose;
    pose.header = places.header;
    pose.pose.pose = places.poses[0];
    for (int i = 0; i < 36; ++i) pose.pose.covariance[i] = found.places[0].covariance[i];
    plan_poses_.publish(pose);
  }

  bool IsSure(const PlanPlaces& found) const {
    return !found.places.empty() && found.places[0].probability >= parameters_.min_plan_probability;
  }

  // As those of images.
  void PublishPlanDiagnostics(const sensor_msgs::LaserScan& scan, const PlanPlaces& found) {
    Diagnostic status;
    status.name = ros::this_node::getName() + ": floor plan";
    status.hardware_id = scan.header.frame_id;
    const bool is_error = !found.error.empty();
    const bool is_sure = found.reason.empty() && IsSure(found);
    status.level = is_error ? Diagnostic::ERROR : is_sure ? Diagnostic::OK : Diagnostic::WARN;
    status.message = is_error                ? found.error
                     : !found.reason.empty() ? found.reason
                     : is_sure               ? "sure"
                                             : "no place is probable enough";
    const steady_clock::time_point now = steady_clock::now();
    const bool is_due =
        now - last_plan_published_ >= std::chrono::duration<double>(parameters_.diagnostics_period_s);
    if (status.level == last_plan_level_ && !is_due) return;
    last_plan_published_ = now;
    last_plan_level_ = status.level;
    status.values = {KeyValue("map", localizer_->map_name()), KeyValue("scans", num_scans_),
                     KeyValue("plan_places", found.places.size()),
                     KeyValue("plan_probability", found.places.empty() ? 0 : found.places[0].probability),
                     KeyValue("plan_elsewhere", found.elsewhere)};
    diagnostic_msgs::DiagnosticArray message;
    message.header.stamp = scan.header.stamp;
    message.status = {status};
    diagnostics_.publish(message);
  }

  void PublishPose(const Answer& answer, const ros::Time& stamp) {
    geometry_msgs::PoseWithCovarianceStamped message;
    message.header.stamp = stamp;
    message.header.frame_id = parameters_.map_frame;
    message.pose.pose = PoseMessage(answer.position, answer.orientation_xyzw);
    for (int i = 0; i < 36; ++i) message.pose.covariance[i] = answer.covariance[i];
    poses_.publish(message);
  }

  // At most once per period, but immediately when it gets better or worse.
  void PublishDiagnostics(const sensor_msgs::Image& image, const Answer& answer, double node_ms) {
    Diagnostic status;
    status.name = ros::this_node::getName() + ": localization";
    status.hardware_id = image.header.frame_id;
    status.level = answer.is_error ? Diagnostic::ERROR : answer.has_fix ? Diagnostic::OK : Diagnostic::WARN;
    status.message = answer.has_fix ? "fix" : answer.message;
    if (answer.is_error) ROS_ERROR_THROTTLE(10, "%s", answer.message.c_str());
    if (const std::string why = localizer_->log_error(); !why.empty())
      ROS_WARN_ONCE("nothing is logged from here on: %s", why.c_str());
    const steady_clock::time_point now = steady_clock::now();
    const bool is_due =
        now - last_published_ >= std::chrono::duration<double>(parameters_.diagnostics_period_s);
    if (status.level == last_level_ && !is_due) return;
    last_published_ = now;
    last_level_ = status.level;
    status.values = {KeyValue("map", localizer_->map_name()),
                     KeyValue("images", num_images_),
                     KeyValue("fixes", num_fixes_),
                     KeyValue("reason", answer.reason),
                     KeyValue("features", answer.num_features),
                     KeyValue("inliers", answer.num_inliers),
                     KeyValue("region", answer.region),
                     KeyValue("scope", answer.scope),
                     KeyValue("probability", answer.probability),
                     KeyValue("work_ms", answer.work_ms),
                     KeyValue("library_ms", answer.library_ms),
                     KeyValue("node_ms", node_ms),
                     KeyValue("kept_bytes", localizer_->num_kept_bytes()),
                     KeyValue("logged", localizer_->num_logged()),
                     KeyValue("next", next_name_)};
    if (velocity_) {
      status.values.push_back(KeyValue("steering", localizer_->IsSteering() ? steering_ : "off"));
      status.values.push_back(KeyValue("steering_why", steering_why_));
    }
    if (parameters_.where) {
      status.values.push_back(KeyValue("place", likely_place_.pose.image));
      status.values.push_back(KeyValue("place_probability", likely_place_.probability));
      status.values.push_back(KeyValue("elsewhere", elsewhere_));
    }
    diagnostic_msgs::DiagnosticArray message;
    message.header.stamp = image.header.stamp;
    message.status = {status};
    diagnostics_.publish(message);
  }

  NodeParameters parameters_;
  MapLocalizer* localizer_;
  ros::Publisher poses_, diagnostics_, starts_, way_, verdicts_, next_, places_;
  ros::Publisher plan_poses_, plan_places_, plan_beliefs_;
  ros::Subscriber images_, goals_, progress_, odometry_, imu_, scans_;
  std::unique_ptr<Velocity> velocity_;  // null: the robot is not steered
  double steered_s_ = 0;                // when the image of the last command was taken
  std::string next_name_, steering_, steering_why_;
  Places::Place likely_place_;
  double elsewhere_ = 1;
  ros::Time asked_;  // when a goal or a report came last
  int64_t num_images_ = 0, num_fixes_ = 0, num_scans_ = 0;
  int last_level_ = -1, last_plan_level_ = -1;
  steady_clock::time_point last_published_, last_plan_published_;
};

}  // namespace
}  // namespace cairn_ros

int main(int argc, char** argv) {
  ros::init(argc, argv, "cairn_localizer");
  const ros::NodeHandle alive;  // connects, so that logging and parameters work from here on
  cairn_ros::NodeParameters parameters;
  int code = 0;
  std::string message;
  if (!cairn_ros::ReadParameters(&parameters, &message)) {
    ROS_FATAL("~%s is of the wrong type; docs/ros.md has the parameters", message.c_str());
    return 2;
  }
  const auto localizer = cairn_ros::MapLocalizer::Open(parameters, &code, &message);
  if (!localizer) {
    ROS_FATAL("%s", message.c_str());
    return code;
  }
  ROS_INFO("%s: %ld landmarks, poses in frame %s", parameters.map.c_str(),
           static_cast<long>(localizer->num_landmarks()), parameters.map_frame.c_str());
  const cairn_ros::LocalizerNode node(parameters, localizer.get());
  ros::spin();
}
