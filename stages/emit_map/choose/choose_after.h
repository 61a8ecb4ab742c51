#pragma once

#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/choose/make_promises.h"
#include "stages/emit_map/previous/match_previous.h"

namespace cairn::emit_map {

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
