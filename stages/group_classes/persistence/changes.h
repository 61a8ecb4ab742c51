#pragma once

#include <vector>

#include "core/world/feature_class.h"
#include "stages/group_classes/persistence/sightings.h"
#include "stages/group_classes/persistence/surroundings.h"

namespace cairn::group_classes {

// Where a place changed from one session to another: classes that vanished (what an earlier session saw is
// probably not there in this one), and such that appeared (what this one is the first to see was probably not
// there before), that lie together on one surface, in dense clusters (in the manner of DBSCAN [Ester et al.
// 1996]); scattered ones are taken for what the light does.  Each has the images that show it best.
//
// Ascending by session, then the largest first.  Pure.
std::vector<PlaceChange> FindChanges(const Classes& classes, const std::vector<ClassAge>& ages,
                                     const std::vector<ClassViews>& views, const ImageSessions& images,
                                     const Surroundings& surroundings);

}  // namespace cairn::group_classes
