#include "pipeline/exchange/bags/frame_tree.h"

#include <algorithm>

namespace cairn::pipeline {

std::set<std::string> FrameChain::Links() const {
  std::set<std::string> links(from_base.begin(), from_base.end());
  links.insert(from_camera.begin(), from_camera.end());
  return links;
}

// The frame itself, its parent, and so on; a ring ends where it closes.
std::vector<std::string> FrameTree::WayUp(const std::string& frame) const {
  std::vector<std::string> way = {frame};
  std::set<std::string> seen = {frame};
  for (auto parent = parents_.find(frame); parent != parents_.end(); parent = parents_.find(way.back())) {
    if (!seen.insert(parent->second).second) break;
    way.push_back(parent->second);
  }
  return way;
}

Result<FrameChain> FrameTree::Chain(const std::string& base, const std::string& camera) const {
  if (base.empty() || camera.empty()) {
    return MakeError(ErrorCode::kNoData, "{} name no frame in their headers",
                     base.empty() ? "messages of odometry" : "images");
  }
  const std::vector<std::string> base_way = WayUp(base);
  const std::vector<std::string> camera_way = WayUp(camera);
  for (auto common = camera_way.begin(); common != camera_way.end(); ++common) {
    const auto met = std::find(base_way.begin(), base_way.end(), *common);
    if (met != base_way.end()) return FrameChain{{base_way.begin(), met}, {camera_way.begin(), common}};
  }
  return MakeError(
      ErrorCode::kNoData,
      "/tf and /tf_static do not say where the frame '{}' is in '{}': the way up ends at '{}' and "
      "'{}'",
      camera, base, camera_way.back(), base_way.back());
}

void FrameMotion::Add(const TransformMessage& transform, int64_t time_ns, bool is_static) {
  const bool is_new = !motions_.contains(transform.child_frame_id);
  Motion& motion = motions_[transform.child_frame_id];
  const Pose& pose = transform.parent_from_child;
  if (is_new) motion.constant = pose;
  if (!is_new && (motion.constant.translation != pose.translation ||
                  motion.constant.rotation.coeffs() != pose.rotation.coeffs()))
    motion.is_constant = motion.is_constant && is_static;
  if (is_static) motion.constant = pose;  // the latest one counts
  motion.trajectory.Add(time_ns, pose);
}

bool FrameMotion::Moves(const std::string& child) const {
  const auto motion = motions_.find(child);
  return motion != motions_.end() && !motion->second.is_constant;
}

void FrameMotion::Sort() {
  for (auto& [child, motion] : motions_) motion.trajectory.Sort();
}

Result<Pose> FrameMotion::Up(const std::vector<std::string>& links, int64_t time_ns, double max_gap_s) const {
  Pose top_from_frame;
  for (const std::string& child : links) {
    const auto motion = motions_.find(child);
    if (motion == motions_.end())
      return MakeError(ErrorCode::kNoData, "the frame '{}' has no valid transform", child);
    Result<Pose> pose = motion->second.is_constant ? Result<Pose>(motion->second.constant)
                                                   : motion->second.trajectory.At(time_ns, max_gap_s);
    if (!pose.ok())
      return MakeError(pose.error().code, "the transform of '{}': {}", child, pose.error().message);
    top_from_frame = *pose * top_from_frame;
  }
  return top_from_frame;
}

Result<Pose> FrameMotion::BaseFromCamera(int64_t time_ns, double max_gap_s) const {
  CAIRN_ASSIGN_OR_RETURN(const Pose top_from_camera, Up(chain_.from_camera, time_ns, max_gap_s));
  CAIRN_ASSIGN_OR_RETURN(const Pose top_from_base, Up(chain_.from_base, time_ns, max_gap_s));
  return top_from_base.Inverse() * top_from_camera;
}

}  // namespace cairn::pipeline
