#pragma once

#include <memory>
#include <optional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "ros/map_localizer.h"
#include "runtime/drive/start_hypotheses.h"
#include "runtime/map/map.h"

namespace cairn_ros {

// Where a robot that was switched on anywhere may have started, while it is under way to a survey image
// (runtime/drive/start_hypotheses.h).
class StartFinder {
 public:
  StartFinder(std::shared_ptr<const cairn::Map> map, const cairn::Pose& robot_from_camera)
      : map_(std::move(map)), robot_from_camera_(robot_from_camera) {}

  // The next image is the first one.  Errors: NotFound (no such image, no words, no appearance graph).
  cairn::Status SetGoal(const std::string& image);
  // "arrived": at the next place of the way; the next image is one of it.  "refuted": the next place is not
  // in sight.  "restarted": back at the start.  Errors: InvalidArgument.
  cairn::Status Report(const std::string& word);
  // Whether the next image is to be looked at.
  bool IsWaiting() const { return is_waiting_; }
  // Errors: as StartHypotheses::Make and ExtractSift.
  cairn::Status Look(const cv::Mat& grey);
  cairn::Result<Starts> Found() const;

 private:
  std::shared_ptr<const cairn::Map> map_;
  cairn::Pose robot_from_camera_;
  std::optional<cairn::PlaceModel> model_;  // once there was a goal
  cairn::NodeIdx goal_ = -1;
  std::optional<cairn::StartHypotheses> starts_;
  std::string verdict_;
  bool is_waiting_ = false;
};

}  // namespace cairn_ros
