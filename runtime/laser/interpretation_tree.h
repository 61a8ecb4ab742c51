#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/options/options.h"
#include "runtime/laser/view_search_index.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {

// Finds where a robot stands from straight stretches of walls that it sees, without a prior.  Implements
// [Simsarian96 §2.3].  Depth of the tree = observed segment, longest first (after Drumheller); branches
// = sides of the plan's walls, and "no wall of the plan" while such null matches are left.  A pairing
// (segment, label) fixes the heading, and the position up to a line of places: the segment may be any portion
// of the wall.  Constraints (after Gaston and Lozano-Perez): the segment is no longer than the wall; for each
// two pairings the headings agree and the lines of places come close.
//
// The standard search branches over all labels.  The VIR search starts with the candidates among the regions
// (index functions), branches over the union of their label sets, and after each pairing provisionally drops
// the candidates that do not see its label, in which none of its places lies, or whose labels with its
// heading are not spread as the segments are; ranked, better candidates come first.  Where every visible wall
// has one segment, its branches are only the labels that keep the order in which a candidate sees its
// walls (view_order.h).
//
// With `fix_pose_early` the tree has two levels: two pairings that cross fix the pose, and the others are
// paired at it without branching, each with the seen label that fits best, and all once more at the pose that
// follows.  Below a first pairing, only places are searched along whose line enough other segments can have a
// wall (place_support.h).
struct InterpretationTreeOptions {
  // "vir" or "standard".
  std::string search = "vir";
  // End with the first complete interpretation instead of all.
  bool first_only = false;
  // Headings of two pairings may differ by this plus what the fits allow, degrees.  REQUIRES: > 0
  double angle_tolerance_deg = 2;
  // Places of two pairings may lie this far apart plus what the fits allow, metres.  REQUIRES: > 0
  double position_tolerance_m = 0.1;
  // A segment may be longer than its wall by this, metres.  REQUIRES: >= 0
  double length_tolerance_m = 0.1;
  // Standard deviations of a fit that count as tolerance.  REQUIRES: >= 0
  double num_sigmas = 3;
  // Largest share of the segments that may belong to no wall of the plan.  REQUIRES: in [0, 1)
  double max_null_ratio = 0;
  // Largest share of a place's visible walls that may be missing among the segments.  REQUIRES: in [0, 1)
  double max_missing_ratio = 0;
  // Index functions: regions must see as many walls as there are segments (within the two ratios), and enough
  // of each length, and no label has two segments.  False: walls may be seen as several segments, or the scan
  // does not go all around.
  bool one_segment_per_wall = true;
  // Candidates are searched in groups, the better ranked first, each group this many times larger than the
  // one before; 1: all at once.  REQUIRES: >= 1
  int rank_growth = 1;
  bool fix_pose_early = true;
  // How far walls stand from where the plan says, each independently: standard deviation of their offset and
  // ends, and of their direction; part of the covariance of solutions.  A laser measures better than plans
  // are drawn.  REQUIRES: >= 0
  double sigma_wall_m = 0.03;
  double sigma_wall_deg = 0.8;
  // Search ends after this many pairings; what was found until then is returned, not complete.
  double max_num_nodes = 1e8;
};
OptionTable DescribeOptions(InterpretationTreeOptions* options);

// One complete interpretation.
struct Interpretation {
  std::vector<LabelIdx> labels;  // per segment; -1: null match
  PlanarPose pose;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // x, y (m), heading (rad)
  // Walls of one direction only: the position along them is not known (its middle is given), the covariance
  // there is that of the free range.
  bool determined = true;
  int num_matched = 0;
  double matched_length_m = 0;
  double hidden_length_m = 0;  // of what was seen but lies behind a wall at this pose: evidence against it
  double rms_m = 0;            // of the matched segments' ends from their walls; at most position_tolerance_m
};

struct InterpretationTreeResult {
  // Different poses only; ordered by most matched length less the hidden length, then by least rms.
  std::vector<Interpretation> solutions;
  int64_t num_nodes = 0;        // pairings tried, null matches included
  int64_t num_expanded = 0;     // pairings that met the constraints
  int64_t num_bound_tests = 0;  // pairings that the bound on support looked at; not among the nodes
  int64_t num_candidates = 0;   // regions that the index functions leave
  bool complete = true;         // false: ended by max_num_nodes or cancelled
};

// Errors: InvalidArgument (options, or the VIR search without regions), NoData (fewer than two segments,
// which determine no pose).
Result<InterpretationTreeResult> SearchInterpretations(const ViewSearchIndex& index,
                                                       const std::vector<ScanSegment>& segments,
                                                       const InterpretationTreeOptions& options);

// Improves an estimate to the pose that best brings segments onto the lines of their labels' walls, with
// their ends not beyond the walls' ends (short walls in a row determine the place along them); labels of -1
// are left out.  Fills pose, covariance, determined, num_matched, matched_length_m and rms_m.
void FitPose(const FloorPlan& plan, const std::vector<ScanSegment>& segments, Interpretation* interpretation);

// Of the ends of a segment from a label's line at a pose, square metres: the sum of both.
double SquaredOffsets(const FloorPlan& plan, const ScanSegment& segment, LabelIdx label,
                      const PlanarPose& pose);

}  // namespace cairn
