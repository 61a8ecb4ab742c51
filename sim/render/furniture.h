#pragma once

#include <cstdint>

#include "sim/render/layout.h"

namespace cairn::sim {

// Adds cabinets, tables, boxes and pillars to the rooms of a layout, up to furniture_ratio of each room's
// floor.  A piece is placed only where the rest of the room stays in one part for a camera that keeps
// clearance_m, doors included.
void PlaceFurniture(const SimulateOptions& options, uint64_t seed, Layout* layout);

}  // namespace cairn::sim
