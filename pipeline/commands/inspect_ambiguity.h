#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// The places of a map that are hardest to tell from others, as text: at most `max_num_places`, most ambiguous
// first, each with its best-scoring look-alike; and as many regions, by the mean of their images.  Empty for
// a map that does not store entropies.
std::string AmbiguityText(const MapRows& rows, int max_num_places);

// As JSON: all nodes, in the map's order, and all regions; nothing for a map that does not store entropies.
nlohmann::ordered_json AmbiguityJson(const MapRows& rows);

}  // namespace cairn::pipeline
