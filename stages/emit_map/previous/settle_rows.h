#pragma once

#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/previous/match_previous.h"

namespace cairn::emit_map {

// Leaves a map as an earlier one of the same place was, where what the survey now says does not contradict
// it: robots that have that one are then sent little (core/delta), and what they do where nothing changed
// stays the same.  Landmarks keep place, size and descriptor where these hold, and their order; new ones
// stand behind the last of their first region.  Images keep their poses, stations their places, nodes their
// figures, where they differ by less than these are known.  Descriptors get the levels of the earlier map's
// code, where it has one.
// REQUIRES: `rows` is made of `classes`, with their ids, its descriptors as these have them, and so far
// without words, region entropies and visual map.
void SettleRows(const Classes& classes, const MapRows& previous, const PreviousMatches& matches,
                MapRows* rows);

// Numbers of what was dropped at a station stay where they hardly differ.  REQUIRES: rows->findings.drops
void SettleDrops(const MapRows& previous, MapRows* rows);

// Landmarks that the earlier map has get its class ids, others such as none of it had.  REQUIRES: the ids are
// those of `classes`; nothing is looked up by them any more.
void KeepClassIds(const Classes& classes, const MapRows& previous, const PreviousMatches& matches,
                  MapRows* rows);

}  // namespace cairn::emit_map
