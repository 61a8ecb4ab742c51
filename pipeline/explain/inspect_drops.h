#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// What the stages dropped, as text: how much for which reason, and what the stations that see the fewest
// landmarks have lost, at most `max_num_stations` of them.  Empty for a map that does not store it.
std::string DropsText(const MapRows& rows, int max_num_stations);

// As JSON: a list, one entry per reason; "at_stations" has a count per station.
nlohmann::ordered_json DropsJson(const MapRows& rows);

}  // namespace cairn::pipeline
