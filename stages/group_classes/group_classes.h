#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/capture/capture.h"
#include "core/colmap/colmap_database.h"
#include "core/options/options.h"
#include "core/structure/triangulate.h"
#include "core/world/dropped_items.h"
#include "core/world/feature_class.h"
#include "stages/group_classes/adjust/adjust_survey.h"
#include "stages/group_classes/find_ambiguous.h"
#include "stages/group_classes/persistence/persistence.h"
#include "stages/group_classes/tracks/posed_images.h"

namespace cairn::group_classes {

// Turns keypoints that match into feature classes: one per scene feature, with its place in space and one
// descriptor.  Before: match_features.  After: filter_visibility, emit_map.  Implements [Sala06 §VI-B]
// (equivalence classes, ambiguity).  Differs from it: keypoints are joined by verified matches
// (core/structure/union_matches.h), not by distance in feature space alone; classes are triangulated from the
// survey's poses and cameras, which are themselves adjusted as far as the images show that they are wrong
// (adjust/adjust_survey.h); a class whose look-alike lies at the same place is that place's duplicate, not
// ambiguous.
struct GroupClassesOptions {
  TriangulateOptions triangulation;
  // "never": the stated poses and cameras are exact.  "always": adjust them (adjust/adjust_survey.h). "auto":
  // all but those of a reconstruction, which already are the optimum of such an adjustment.
  std::string refine_poses = "auto";
  // Largest reprojection error in the first triangulation, before poses are refined, pixels.  REQUIRES: > 0
  double initial_reprojection_error_px = 12.0;
  AdjustSurveyOptions adjustment;
  FindAmbiguousOptions ambiguity;
  PersistenceOptions persistence;
};
OptionTable DescribeOptions(GroupClassesOptions* options);

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
  SurveyFindings findings;                   // where they were
  std::vector<SessionPersistence> sessions;  // of a survey of several
};

// Same result for any thread count, and for any file of what was `solved` before (adjust/solved_file.h),
// which may be null.  `sessions`: those that the capture was joined from, in the order of time, if there are
// several: then classes have an age, and those that are probably gone by now are `vanished`
// (persistence/persistence.h).  `scratch_beside`: a file beside which matches that memory has no room for are
// sorted; "": all are in memory.  Classes are ascending by their first observation.  Errors: InvalidArgument
// (options), NoData (no posed image, or no class left: says what dropped the most), Unsupported (more
// keypoints than 2^31), Cancelled; where matches are read from a file, Corrupt; where they are sorted in one,
// ReadOnly, DiskFull, Io.
Result<GroupClassesResult> GroupClasses(const MatchedFeatures& matched, const Capture& capture,
                                        const GroupClassesOptions& options, int num_threads,
                                        Progress& progress, SolvedFile* solved = nullptr,
                                        const std::vector<std::string>& sessions = {},
                                        const std::string& scratch_beside = "");

}  // namespace cairn::group_classes
