#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// Where a place changed from one survey to another, as its map knows it (MapFindings::changes).

// The changes that B knows and A does not: of sessions that A lacks.  A map of one survey names none, and
// knows of no change.
std::vector<MapChange> ChangesSince(const MapRows& a, const MapRows& b);

// For people: a line each, of the first `max_num_lines`; places in the floor frame.
std::string PlaceChangesText(const MapRows& rows, const std::vector<MapChange>& changes, int max_num_lines);
// For programs: all of them.
nlohmann::ordered_json PlaceChangesJson(const MapRows& rows, const std::vector<MapChange>& changes);

}  // namespace cairn::pipeline
