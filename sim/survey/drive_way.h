#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "core/world/appearance_graph.h"

namespace cairn::sim {

// The images, as nodes, that a robot goes to one after the other before its goal.
class DriveWay {
 public:
  DriveWay() = default;
  explicit DriveWay(std::vector<NodeIdx> nodes) : nodes_(std::move(nodes)) {}

  const std::vector<NodeIdx>& nodes() const { return nodes_; }
  // Index of the node that it goes to next; past the last one: the goal.
  size_t next() const { return next_; }
  bool LeadsToGoal() const { return next_ >= nodes_.size(); }

  // The robot knows where it stands, and goes to the node at `index` first.
  void BeginAt(size_t index) {
    next_ = index;
    has_left_out_ = false;
  }
  void Arrive() { BeginAt(next_ + 1); }
  // Never two in a row: a robot that reaches neither may be off its way.
  bool MayLeaveOut() const { return !has_left_out_; }
  void LeaveOut() {
    ++next_;
    has_left_out_ = true;
  }

 private:
  std::vector<NodeIdx> nodes_;
  size_t next_ = 0;
  bool has_left_out_ = false;  // the one before the next
};

}  // namespace cairn::sim
