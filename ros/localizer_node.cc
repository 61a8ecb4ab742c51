// A ROS node that says where a camera is in a cairn map: image in, pose out.  docs/ros.md tells its topics
// and parameters.
#include <chrono>
#include <memory>
#include <string>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>

#include "ros/map_localizer.h"

namespace cairn_ros {
namespace {

using Diagnostic = diagnostic_msgs::DiagnosticStatus;
using std::chrono::steady_clock;

struct NodeParameters : Parameters {
  std::string map_frame = "map";
  double diagnostics_period_s = 1;  // 0: with every image
};

NodeParameters ReadParameters() {
  const ros::NodeHandle node("~");
  NodeParameters p;
  node.getParam("map", p.map);
  node.getParam("memory_budget_mib", p.memory_budget_mib);
  node.getParam("public_key", p.public_key);
  node.getParam("map_frame", p.map_frame);
  node.getParam("follow", p.follow);
  node.getParam("camera_in_robot", p.camera_in_robot);
  node.getParam("camera_model", p.camera_model);
  node.getParam("camera_params", p.camera_params);
  node.getParam("diagnostics_period_s", p.diagnostics_period_s);
  return p;
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

class LocalizerNode {
 public:
  LocalizerNode(NodeParameters parameters, MapLocalizer* localizer)
      : parameters_(std::move(parameters)), localizer_(localizer) {
    ros::NodeHandle node;
    poses_ = node.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 1);
    diagnostics_ = node.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 1);
    // The newest image only: what waits is old.
    images_ = node.subscribe("image", 1, &LocalizerNode::OnImage, this, ros::TransportHints().tcpNoDelay());
  }

 private:
  void OnImage(const sensor_msgs::Image::ConstPtr& image) {
    const steady_clock::time_point begin = steady_clock::now();
    const Answer answer = localizer_->Locate(
        {image->encoding, image->width, image->height, image->step, image->data.data(), image->data.size()});
    ++num_images_;
    if (answer.has_fix) {
      ++num_fixes_;
      PublishPose(answer, image->header.stamp);
    }
    const std::chrono::duration<double, std::milli> in_all = steady_clock::now() - begin;
    PublishDiagnostics(*image, answer, in_all.count());
  }

  void PublishPose(const Answer& answer, const ros::Time& stamp) {
    geometry_msgs::PoseWithCovarianceStamped message;
    message.header.stamp = stamp;
    message.header.frame_id = parameters_.map_frame;
    message.pose.pose.position.x = answer.position[0];
    message.pose.pose.position.y = answer.position[1];
    message.pose.pose.position.z = answer.position[2];
    message.pose.pose.orientation.x = answer.orientation_xyzw[0];
    message.pose.pose.orientation.y = answer.orientation_xyzw[1];
    message.pose.pose.orientation.z = answer.orientation_xyzw[2];
    message.pose.pose.orientation.w = answer.orientation_xyzw[3];
    for (int i = 0; i < 36; ++i) message.pose.covariance[i] = answer.covariance[i];
    poses_.publish(message);
  }

  // At most once in a period, but at once when it gets better or worse.
  void PublishDiagnostics(const sensor_msgs::Image& image, const Answer& answer, double node_ms) {
    Diagnostic status;
    status.name = ros::this_node::getName() + ": localization";
    status.hardware_id = image.header.frame_id;
    status.level = answer.is_error ? Diagnostic::ERROR : answer.has_fix ? Diagnostic::OK : Diagnostic::WARN;
    status.message = answer.has_fix ? "fix" : answer.message;
    if (answer.is_error) ROS_ERROR_THROTTLE(10, "%s", answer.message.c_str());
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
                     KeyValue("library_ms", answer.library_ms),
                     KeyValue("node_ms", node_ms),
                     KeyValue("kept_bytes", localizer_->num_kept_bytes())};
    diagnostic_msgs::DiagnosticArray message;
    message.header.stamp = image.header.stamp;
    message.status = {status};
    diagnostics_.publish(message);
  }

  NodeParameters parameters_;
  MapLocalizer* localizer_;
  ros::Publisher poses_, diagnostics_;
  ros::Subscriber images_;
  int64_t num_images_ = 0, num_fixes_ = 0;
  int last_level_ = -1;
  steady_clock::time_point last_published_;
};

}  // namespace
}  // namespace cairn_ros

int main(int argc, char** argv) {
  ros::init(argc, argv, "cairn_localizer");
  const ros::NodeHandle alive;  // connects, so that what follows can be logged and parameters read
  const cairn_ros::NodeParameters parameters = cairn_ros::ReadParameters();
  int code = 0;
  std::string message;
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
