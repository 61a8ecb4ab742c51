#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/pose.h"
#include "core/geometry/trajectory.h"
#include "pipeline/exchange/bags/messages.h"

namespace cairn::pipeline {

// Links from a frame up to one that both have above them.
struct FrameChain {
  std::vector<std::string> from_base;    // child frames, the base's first
  std::vector<std::string> from_camera;  // likewise
  std::set<std::string> Links() const;
};

// ROS's frames (/tf, /tf_static): which is mounted on which.
class FrameTree {
 public:
  // The first parent of a frame counts.
  void AddLink(const std::string& parent, const std::string& child) { parents_.emplace(child, parent); }
  // Errors: NoData, naming both frames and where the way up from each ends; a frame without a name.
  Result<FrameChain> Chain(const std::string& base, const std::string& camera) const;

 private:
  std::vector<std::string> WayUp(const std::string& frame) const;
  std::map<std::string, std::string> parents_;
};

// The poses of a chain's links over time.
class FrameMotion {
 public:
  explicit FrameMotion(FrameChain chain) : chain_(std::move(chain)), links_(chain_.Links()) {}
  bool Needs(const std::string& child) const { return links_.contains(child); }
  // Links on /tf_static hold for ever, as do those that never change.
  void Add(const TransformMessage& transform, int64_t time_ns, bool is_static);
  // Whether poses of the link differ: its times count.
  bool Moves(const std::string& child) const;
  // To be called once, before BaseFromCamera.
  void Sort();
  // Errors: NoData (a link without a pose near that time; names it).
  Result<Pose> BaseFromCamera(int64_t time_ns, double max_gap_s) const;

 private:
  struct Motion {
    Trajectory trajectory;
    Pose constant;
    bool is_constant = true;
  };
  Result<Pose> Up(const std::vector<std::string>& links, int64_t time_ns, double max_gap_s) const;

  FrameChain chain_;
  std::set<std::string> links_;
  std::map<std::string, Motion> motions_;
};

}  // namespace cairn::pipeline
