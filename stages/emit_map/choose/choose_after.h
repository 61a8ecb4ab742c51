#pragma once

#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/choose/make_promises.h"
#include "stages/emit_map/previous/match_previous.h"

namespace cairn::emit_map {

// Whether images that an earlier map's sessions do not have are more than a fifth of all that a map of today
// would be of: then what the new places need is found by trials, with the landmarks that are still there
// first.
bool IsMostlyNew(const Classes& classes, const MapRows& previous);
// The classes of landmarks that are still there, in the earlier map's order.
std::vector<size_t> StillThere(const std::vector<char>& may_keep, const PreviousMatches& matches);

struct ChosenAfter {
  std::vector<char> keep;  // per class
  Promises promises;
};

// The landmarks of an earlier map that are still there, and the fewest more with which every place promises
// what it has to and, where a part of them is gone, expects about as many matches as before.  Nothing is
// tried: promises are made as they were then.  Regions stay what they were, with what is new there, unless
// one then has too many landmarks: then all are divided anew.  A region's change costs its own work, and a
// fleet's robots little (core/delta); who would have the fewest landmarks again compiles without the earlier
// map. `may_keep`: per class, whether the map may have it.  REQUIRES: previous.findings.promise
ChosenAfter ChooseAfter(const Classes& classes, const std::vector<char>& may_keep, const MapRows& previous,
                        const PreviousMatches& matches, const PromiseOptions& options, int num_threads);

}  // namespace cairn::emit_map
