#pragma once

#include <span>
#include <vector>

#include "core/world/feature_class.h"

namespace cairn::group_classes {

// The classes of a change, by position in Classes::classes.
struct ChangedClasses {
  std::vector<int> vanished;
  std::vector<int> appeared;
};

// What vanished at one change and appeared at another of the same session, or elsewhere in the same, is a
// thing that moved: its classes have the same descriptors, and a rigid motion takes their places to the new
// ones (RANSAC over three pairs, as [Fischler & Bolles 1981]; a fixed seed).  Sets moved_to and num_moved of
// these changes, all of one session, with the classes of each; `first` is the position of the first in
// Classes::changes.  `typical_distance`: from which classes are seen.
void FindMoves(const Classes& classes, std::span<const ChangedClasses> members, int first,
               double typical_distance, std::span<PlaceChange> changes);

}  // namespace cairn::group_classes
