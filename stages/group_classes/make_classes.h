#pragma once

#include <vector>

#include "core/structure/triangulate.h"
#include "core/structure/union_matches.h"
#include "core/world/dropped_items.h"
#include "core/world/feature_class.h"
#include "stages/group_classes/group_classes.h"

namespace cairn::group_classes {

// Classes from the tracks that triangulate, without the ambiguous ones, ascending by first observation;
// counts dropped tracks and keypoints in classes->dropped and appends them to `dropped_items`: each track
// either becomes a class or is dropped for one reason, and each keypoint of a track that becomes one is an
// observation or an outlier.  triangulations[t] is that of tracks[t]; matched_idx[i] is where image i of the
// tracks is in matched.images.
// Errors: as MatchReader.
Status MakeClasses(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                   const std::vector<Triangulation>& triangulations, const std::vector<int>& matched_idx,
                   const GroupClassesOptions& options, Classes* classes,
                   std::vector<DroppedItem>* dropped_items);

}  // namespace cairn::group_classes
