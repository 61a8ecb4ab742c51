#include "ros/start_finder.h"

#include <algorithm>
#include <utility>

#include "core/features/sift.h"
#include "ros/survey_pose.h"
#include "runtime/drive/image_servo.h"
#include "runtime/drive/route.h"

namespace cairn_ros {

using namespace cairn;  // NOLINT: this file is the bridge

namespace {

// As many matches as make a link of the appearance graph: the robot sees what the image shows.
constexpr int kMinSeenInliers = 20;

}  // namespace

Status StartFinder::SetGoal(const std::string& image) {
  is_waiting_ = false;
  starts_.reset();
  way_.clear();
  next_.reset();
  if (!model_) {
    CAIRN_ASSIGN_OR_RETURN(model_, PlaceModel::Make(*map_));
  }
  CAIRN_ASSIGN_OR_RETURN(goal_image_, FindImage(*map_, image));
  goal_ = model_->NodeOfImage(goal_image_);
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
    if (starts_->Refute()) return Switch();
    verdict_ = VerdictName(HypothesisVerdict::kLost);
    next_.reset();
  } else if (word == "restarted") {
    starts_->Restart();
    return TakeWay(starts_->hypotheses()[starts_->followed()].path.nodes, nullptr, std::nullopt);
  } else {
    return MakeError(ErrorCode::kInvalidArgument,
                     "progress '{}'; expected 'arrived', 'refuted' or 'restarted'", word);
  }
  return Ok();
}

Status StartFinder::TakeWay(std::vector<NodeIdx> way, const Features* features,
                            const std::optional<Camera>& camera) {
  way_ = std::move(way);
  next_ = way_.size() > 1 ? 1 : 0;
  if (!is_steered_ || features == nullptr || !camera || *next_ == 0) return Ok();
  CAIRN_ASSIGN_OR_RETURN(const ServoTarget second, TargetOfImage(*map_, Next(), camera));
  if (NumAgreeing(*features, second, *camera, {}) < kMinSeenInliers) next_ = 0;
  return Ok();
}

Status StartFinder::Switch() {
  verdict_ = VerdictName(HypothesisVerdict::kSwitch);
  next_.reset();
  const int followed = starts_->followed();
  if (!is_steered_) {
    way_ = starts_->hypotheses()[followed].path.nodes;
    return Ok();
  }
  if (const std::optional<NodePath> path = starts_->Replan(followed))
    return TakeWay(path->nodes, nullptr, std::nullopt);
  verdict_ = VerdictName(HypothesisVerdict::kLost);  // no way leads on from here
  return Ok();
}

Status StartFinder::Look(const cv::Mat& grey, const std::optional<Camera>& camera) {
  CAIRN_ASSIGN_OR_RETURN(const Features features, ExtractSift(grey, {}));
  const PlaceScores seen = model_->Look(features.descriptors);
  if (!starts_) {
    CAIRN_ASSIGN_OR_RETURN(starts_, StartHypotheses::Make(*model_, seen, goal_));
    is_waiting_ = false;
    verdict_ = VerdictName(HypothesisVerdict::kFollow);
    return TakeWay(starts_->hypotheses()[starts_->followed()].path.nodes, &features, camera);
  }
  is_waiting_ = false;
  const HypothesisVerdict verdict = starts_->Observe(seen);
  if (verdict == HypothesisVerdict::kSwitch) return Switch();
  verdict_ = VerdictName(verdict);
  if (verdict == HypothesisVerdict::kLost) next_.reset();
  if (!next_) return Ok();
  const bool is_at_goal = IsGoalNext();
  ++*next_;
  if (is_at_goal) {
    next_.reset();
    verdict_ = "goal";
  }
  return Ok();
}

int32_t StartFinder::Next() const {
  if (!next_) return -1;
  return IsGoalNext() ? goal_image_ : model_->ImagesOfNode(way_[*next_]).front();
}

Result<Starts> StartFinder::Found() const {
  Starts found;
  if (!starts_) return found;
  found.verdict = verdict_;
  const auto pose_of = [&](NodeIdx place) {
    return SurveyPoseOf(*map_, model_->ImagesOfNode(place).front(), robot_from_camera_);
  };
  for (const StartHypothesis& start : starts_->hypotheses()) {
    CAIRN_ASSIGN_OR_RETURN(const SurveyPose pose, pose_of(start.start));
    found.starts.push_back({pose, start.posterior});
  }
  found.followed = starts_->followed();
  for (const NodeIdx place : way_) {
    CAIRN_ASSIGN_OR_RETURN(const SurveyPose pose, pose_of(place));
    found.way.push_back(pose);
  }
  if (const int32_t next = Next(); next >= 0) {
    CAIRN_ASSIGN_OR_RETURN(found.next, map_->ImageName(next));
  }
  return found;
}

}  // namespace cairn_ros
