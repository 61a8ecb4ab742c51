#pragma once

#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"

namespace cairn {

// Stations with what lies beside what, images, and nodes of the appearance graph, as blocks of a map
// (core/blocks/map_blocks.h), one of all of a kind: a varint of its bytes, and these.  Without the lists of
// landmarks that images see, and without regions; the last, of how well nodes can be told from others, is
// empty where that is not known.  Elements that two maps have under the same numbers have the same bytes.
// REQUIRES: all nodes have an entropy, or none has
std::string WriteRowText(const MapRows& rows);

// Fills in the stations, images and nodes of `rows`, which has as many of them, and its station edges; what
// images see stays.  Errors: Corrupt, with `what` before it.
Status ReadRowText(std::string_view bytes, const std::string& what, MapRows* rows);

}  // namespace cairn
