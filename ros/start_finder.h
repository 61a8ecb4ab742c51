#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/camera/camera.h"
#include "ros/map_localizer.h"
#include "runtime/drive/start_hypotheses.h"
#include "runtime/map/map.h"

namespace cairn_ros {

// Where a robot that was switched on anywhere may have started, while it is under way to a survey image
// (runtime/drive/start_hypotheses.h), and which image it goes to next.
class StartFinder {
 public:
  // `is_steered`: where another start leads, the way goes on from where the robot would be by now; else the
  // robot goes back to its start first.
  StartFinder(std::shared_ptr<const cairn::Map> map, const cairn::Pose& robot_from_camera, bool is_steered)
      : map_(std::move(map)), robot_from_camera_(robot_from_camera), is_steered_(is_steered) {}

  // The next image is the first one.  Errors: NotFound (no such image, no words, no appearance graph).
  cairn::Status SetGoal(const std::string& image);
  // "arrived": at the next place of the way; the next image is one of it.  "refuted": the next place is not
  // in sight.  "restarted": back at the start.  Errors: InvalidArgument.
  cairn::Status Report(const std::string& word);
  // Whether the next image is to be looked at.
  bool IsWaiting() const { return is_waiting_; }
  // A robot that is steered begins with the second image of its way if it sees that from here, for which it
  // needs the camera.  Errors: as StartHypotheses::Make and ExtractSift.
  cairn::Status Look(const cv::Mat& grey, const std::optional<cairn::Camera>& camera);
  cairn::Result<Starts> Found() const;

  // The survey image of the next place, the last of them the goal; -1: none, without a goal, at the goal,
  // lost, or on the way back to its start.
  int32_t Next() const;
  bool IsGoalNext() const { return next_ && *next_ + 1 == way_.size(); }

 private:
  // After another start took the lead.  Errors: as TargetOfImage.
  cairn::Status Switch();
  // `features`: of where it begins; null: not known.
  cairn::Status TakeWay(std::vector<cairn::NodeIdx> way, const cairn::Features* features,
                        const std::optional<cairn::Camera>& camera);

  std::shared_ptr<const cairn::Map> map_;
  cairn::Pose robot_from_camera_;
  bool is_steered_;
  std::optional<cairn::PlaceModel> model_;  // once there was a goal
  int32_t goal_image_ = -1;
  cairn::NodeIdx goal_ = -1;
  std::optional<cairn::StartHypotheses> starts_;
  std::string verdict_;
  bool is_waiting_ = false;
  std::vector<cairn::NodeIdx> way_;
  std::optional<size_t> next_;  // place of the way; none: see Next
};

}  // namespace cairn_ros
