#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"
#include "runtime/laser/interpretation_tree.h"
#include "runtime/scans/read_scans.h"

namespace cairn {

class BeamModel;     // runtime/beams/beam_model.h
class PlanRays;      // runtime/beams/plan_rays.h
class WallField;     // runtime/beams/wall_field.h
struct BeamEnd;      // runtime/beams/pose_search.h
struct WeighedPose;  // runtime/beams/beam_model.h

struct ScanLocatorOptions {
  // Where poses come from that are then judged by all beams: "beams", from the places and headings at which
  // the ends of beams lie at walls; "vir" and "standard", from pairings of segments with walls
  // (interpretation_tree.h).
  std::string search = "beams";
  // Hypotheses less probable than this share of the first are left out.  REQUIRES: in (0, 1]
  double least_odds = 0.01;
  // Of the segments, and of the two searches by them; its `search` and `first_only` do not matter. Tolerances
  // are those that walls of buildings need, which stand only about where plans say.
  InterpretationTreeOptions tree{.angle_tolerance_deg = 3,
                                 .position_tolerance_m = 0.15,
                                 .length_tolerance_m = 0.4,
                                 .max_null_ratio = 0.4,
                                 .one_segment_per_wall = false,
                                 .sigma_wall_m = 0.04,
                                 .max_num_nodes = 2e6};
};
OptionTable DescribeOptions(ScanLocatorOptions* options);

// Where a scan may have been taken.  Walls of segments, length matched and hidden: of those segments that lie
// at a wall which is seen from there.
struct ScanHypothesis : Interpretation {
  double probability = 0;      // among all hypotheses, and a place that the plan does not show
  double explained_ratio = 0;  // of the beams that met something: those that ended at walls of the plan
  bool is_expected = false;    // of Locate's `expected`, or in a row with one of them
};

// Whether a place is known: of a covariance of x, y (m) and heading (rad), no standard deviation is more than
// 0.25 m, or 10 degrees.
bool IsDetermined(const Eigen::Matrix3d& covariance);

struct LocatedScan {
  // The most probable first.  `determined`: false where the place along some direction is not known, as in a
  // corridor; the covariance there is that of all places which explain the scan as well.
  std::vector<ScanHypothesis> hypotheses;
  int64_t num_tried = 0;  // windows of places, or pairings
  bool complete = true;   // false: there may be more hypotheses
};

// Finds where a laser scan was taken in a floor plan, without a prior: a search for poses, each moved to
// where the beams fit best, and judged by all beams: those that end at walls, those that end before them, and
// those that would have passed through.
class ScanLocator {
 public:
  // `views` outlives this.  By beams, only their plan's walls are read.
  // Errors: InvalidArgument (options, "vir" without regions), NoData (no wall), Unsupported (a plan of more
  // than 0.5 square kilometres: of millimetres?).
  static Result<ScanLocator> Make(const Views& views, const ScanLocatorOptions& options);

  // `expected`: where it may have been, besides the poses that are searched for; hypotheses near to these are
  // never left out.  Deterministic.
  // Errors: NoData (too few beams that met something; by segments: fewer than two).
  Result<LocatedScan> Locate(const ScanView& scan, std::span<const PlanarPose> expected = {}) const;
  // Near to these alone: a hundredth of the time.
  Result<LocatedScan> LocateNear(const ScanView& scan, std::span<const PlanarPose> expected) const;

 private:
  ScanLocator(const Views& views, const ScanLocatorOptions& options);
  WeighedPose Weighed(const std::vector<Beam>& beams, const PlanarPose& pose) const;
  Result<LocatedScan> Locate(const ScanView& scan, std::span<const PlanarPose> expected, bool searches) const;
  // Where poses come from; weighed by a `few` of the beams.
  std::vector<WeighedPose> PosesByBeams(const std::vector<BeamEnd>& ends, const std::vector<Beam>& few,
                                        LocatedScan* located) const;
  Result<std::vector<WeighedPose>> PosesBySegments(const ScanView& scan, const std::vector<Beam>& few,
                                                   LocatedScan* located) const;
  // The pose near to an expected one at which the beams fit best; weighed by a `few` of them.
  WeighedPose BestNear(const PlanarPose& pose, const std::vector<BeamEnd>& ends,
                       const std::vector<Beam>& few) const;
  void Interpret(const std::vector<ScanSegment>& segments, ScanHypothesis* found) const;

  const FloorPlan* plan_;
  ScanLocatorOptions options_;
  std::shared_ptr<const PlanRays> rays_;
  std::shared_ptr<const WallField> field_;
  std::shared_ptr<const ViewSearchIndex> index_;  // for searches by segments
  std::shared_ptr<const BeamModel> model_;
};

}  // namespace cairn
