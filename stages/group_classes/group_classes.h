#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/capture/capture.h"
#include "core/colmap/colmap_database.h"
#include "core/options/options.h"
#include "core/world/dropped_items.h"
#include "core/world/feature_class.h"
#include "stages/group_classes/find_ambiguous.h"
#include "stages/group_classes/refine_poses.h"
#include "stages/group_classes/triangulate.h"

namespace cairn::group_classes {

// Turns keypoints that match into feature classes: one per scene feature, with its place in space and one
// descriptor.  Before: match_features.  After: filter_visibility, emit_map.  Implements [Sala06 §VI-B]
// (equivalence classes, ambiguity).  Differs from it: keypoints are joined by verified matches
// (union_matches.h), not by distance in feature space alone; classes are triangulated from the survey's
// poses, which are themselves refined as far as their stated noise allows (refine_poses.h); a class whose
// look-alike lies at the same place is that place's duplicate, not ambiguous.
struct GroupClassesOptions {
  TriangulateOptions triangulation;
  // "never": the stated poses are exact.  "always": refine them.  "auto": refine when the first
  // triangulation's root mean square error exceeds auto_refine_error_px; reconstructed poses, which already
  // are the optimum of such an adjustment, are never refined.
  std::string refine_poses = "auto";
  double auto_refine_error_px = 1.0;  // REQUIRES: > 0
  // Largest reprojection error in the first triangulation, before poses are refined, pixels.  REQUIRES: > 0
  double initial_reprojection_error_px = 12.0;
  // Rounds of refinement, each followed by a new triangulation.  REQUIRES: >= 1
  int num_rounds = 2;
  RefinePosesOptions refinement;
  FindAmbiguousOptions ambiguity;
};
OptionTable DescribeOptions(GroupClassesOptions* options);

// What the stage needs of matches.db.
struct MatchedFeatures {
  std::map<CameraId, Camera> cameras;
  std::vector<DatabaseImage> images;        // ascending image_id
  std::vector<Features> features;           // per image
  std::vector<TwoViewGeometry> geometries;  // ascending pair
};
Result<MatchedFeatures> ReadMatchedFeatures(const std::string& matches_path);

struct GroupClassesResult {
  Classes classes;
  // Images, pairs, tracks and keypoints that did not become part of a class, each with its reason.
  std::vector<DroppedItem> dropped_items;
  int64_t num_tracks = 0;
  int64_t num_conflicts = 0;  // matches not followed because they join two keypoints of one image
  // Refinement: root mean square reprojection errors before and after, pixels; equal when poses were
  // not refined.
  double initial_rms_px = 0;
  double final_rms_px = 0;
  bool poses_refined = false;
};

// Pure; same result for any thread count.  Classes are ascending by their first observation.  Errors:
// InvalidArgument (options), NoData (no posed image, or no class left: says what dropped the
// most), Cancelled.
Result<GroupClassesResult> GroupClasses(const MatchedFeatures& matched, const Capture& capture,
                                        const GroupClassesOptions& options, int num_threads,
                                        Progress& progress);

}  // namespace cairn::group_classes
