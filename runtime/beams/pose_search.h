#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/planar_pose.h"
#include "runtime/beams/wall_field.h"
#include "runtime/scans/beam.h"

namespace cairn {

struct PoseSearchOptions {
  // From heading to heading, degrees.
  double step_deg = 2;
  // Poses that fit less well than this share of the best are left out.
  double least_share = 0.7;
  int max_num_poses = 400;
  // The search ends after so many ends were looked up in windows of places.
  int64_t max_num_lookups = 400'000'000;
};

struct FieldPose {
  PlanarPose pose;
  double fit = 0;  // of the points, mean of the field: 0 to 1
};

struct PoseSearchResult {
  std::vector<FieldPose> poses;  // the best first, 0.35 m or 8 degrees apart
  int64_t num_windows = 0;       // looked at
  bool complete = true;          // false: there may be more poses that fit as well as was asked
};

// Where a beam ended, robot frame, metres.
struct BeamEnd {
  Eigen::Vector2d place;
  std::optional<double> along_rad;  // direction of the wall there, either way, where its neighbours tell
};

// The ends of beams, in their order, that are `apart_m` from all kept before them.
std::vector<BeamEnd> EndsApart(const std::vector<Beam>& beams, double apart_m);

// Poses at which ends lie near walls, all but those near to better ones: branch and bound over headings and
// windows of places.  Deterministic.
PoseSearchResult SearchPoses(const WallField& field, const std::vector<BeamEnd>& ends,
                             const PoseSearchOptions& options);

// The pose near to one of these at which ends lie on the walls nearest to them, whether or not these are
// seen. `walls`: the field's.
PlanarPose RefineByEnds(const WallField& field, const std::vector<PlanWall>& walls,
                        const std::vector<BeamEnd>& ends, const PlanarPose& pose);

}  // namespace cairn
