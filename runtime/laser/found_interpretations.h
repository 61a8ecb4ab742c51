#pragma once

#include <vector>

#include "runtime/laser/pairing.h"

namespace cairn {

// Complete interpretations at different poses, of the segments of one scan.
class FoundInterpretations {
 public:
  // All arguments outlive this.
  FoundInterpretations(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
                       const InterpretationTreeOptions& options)
      : plan_(plan), segments_(segments), options_(options) {}

  // How far a segment lies from a label's wall at a pose (and its covariance), in units of what is allowed;
  // > 1: too far.
  double Misfit(const Interpretation& found, int segment, LabelIdx label) const;

  // Whether some point of a segment is seen from a pose, with no wall of the plan before it.
  bool IsSeen(const Interpretation& found, int segment) const;

  // Keeps labels (one per segment; -1: none) whose walls are seen from the pose that follows from them; those
  // that do not fit it are removed, the worst first, while enough are left.  Of two at one pose the one with
  // more matched length stays.  Returns whether a solution was added.
  bool Add(const std::vector<LabelIdx>& labels);

  // Whether a solution has both pairings.
  bool HasBoth(int a, LabelIdx label_a, int b, LabelIdx label_b) const;

  // Without those whose matched segments lie too far off in the mean.
  std::vector<Interpretation> TakeRanked();

 private:
  // Whether a place lies in the box of the plan's domain.
  bool IsInPlan(const Eigen::Vector2d& place) const;
  // The matched segment that lies farthest from its wall or is not seen, -1: all fit.
  int WorstPairing(const Interpretation& found) const;

  const FloorPlan& plan_;
  const std::vector<ScanSegment>& segments_;
  const InterpretationTreeOptions& options_;
  std::vector<Interpretation> solutions_;
};

}  // namespace cairn
