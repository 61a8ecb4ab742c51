#include "ros/start_finder.h"

#include <algorithm>

#include "core/features/sift.h"
#include "runtime/drive/route.h"

namespace cairn_ros {

using namespace cairn;  // NOLINT: this file is the bridge

Status StartFinder::SetGoal(const std::string& image) {
  is_waiting_ = false;
  starts_.reset();
  if (!model_) {
    CAIRN_ASSIGN_OR_RETURN(model_, PlaceModel::Make(*map_));
  }
  CAIRN_ASSIGN_OR_RETURN(const int32_t number, FindImage(*map_, image));
  goal_ = model_->NodeOfImage(number);
  if (goal_ < 0) return MakeError(ErrorCode::kNotFound, "goal {} is not in the appearance graph", image);
  is_waiting_ = true;
  return Ok();
}

Status StartFinder::Report(const std::string& word) {
  if (!starts_)
    return MakeError(ErrorCode::kInvalidArgument,
                     "progress '{}': there is no goal, or no image since it came", word);
  if (word == "arrived") {
    is_waiting_ = true;
  } else if (word == "refuted") {
    verdict_ = VerdictName(starts_->Refute() ? HypothesisVerdict::kSwitch : HypothesisVerdict::kLost);
  } else if (word == "restarted") {
    starts_->Restart();
  } else {
    return MakeError(ErrorCode::kInvalidArgument,
                     "progress '{}'; expected 'arrived', 'refuted' or 'restarted'", word);
  }
  return Ok();
}

Status StartFinder::Look(const cv::Mat& grey) {
  CAIRN_ASSIGN_OR_RETURN(const Features features, ExtractSift(grey, {}));
  const PlaceScores seen = model_->Look(features.descriptors);
  if (starts_) {
    verdict_ = VerdictName(starts_->Observe(seen));
  } else {
    CAIRN_ASSIGN_OR_RETURN(starts_, StartHypotheses::Make(*model_, seen, goal_));
    verdict_ = VerdictName(HypothesisVerdict::kFollow);
  }
  is_waiting_ = false;
  return Ok();
}

Result<Starts> StartFinder::Found() const {
  Starts found;
  if (!starts_) return found;
  found.verdict = verdict_;
  const auto pose_of = [&](NodeIdx place) -> Result<SurveyPose> {
    const int32_t image = model_->ImagesOfNode(place).front();
    CAIRN_ASSIGN_OR_RETURN(const Pose cam_from_world, PoseOfImage(*map_, image));
    const Pose world_from_robot = (robot_from_camera_ * cam_from_world).Inverse();
    SurveyPose pose;
    CAIRN_ASSIGN_OR_RETURN(pose.image, map_->ImageName(image));
    std::copy_n(world_from_robot.translation.data(), 3, pose.position);
    std::copy_n(world_from_robot.rotation.coeffs().data(), 4, pose.orientation_xyzw);  // Eigen's order too
    return pose;
  };
  for (const StartHypothesis& start : starts_->hypotheses()) {
    CAIRN_ASSIGN_OR_RETURN(const SurveyPose pose, pose_of(start.start));
    found.starts.push_back({pose, start.posterior});
  }
  found.followed = starts_->followed();
  for (const NodeIdx place : starts_->hypotheses()[found.followed].path.nodes) {
    CAIRN_ASSIGN_OR_RETURN(const SurveyPose pose, pose_of(place));
    found.way.push_back(pose);
  }
  return found;
}

}  // namespace cairn_ros
