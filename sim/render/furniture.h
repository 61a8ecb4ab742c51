#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sim/render/layout.h"

namespace cairn::sim {

// Adds cabinets, tables, boxes and pillars to the rooms of a layout, up to furniture_ratio of each room's
// floor.  A piece is placed only where the rest of the room stays in one part for a camera that keeps
// clearance_m, doors included.
void PlaceFurniture(const SimulateOptions& options, uint64_t seed, Layout* layout);

// The pieces after options.change, per piece of the layout; nothing where it is gone.  Pillars stay.  A piece
// that moves gets another place in its room, turned as it is and off its old place, on the same terms, and at
// a wall where it stood at one; where none is found, it stays.
std::vector<std::optional<Furniture>> FurnitureAfterChange(const SimulateOptions& options, uint64_t seed,
                                                           const Layout& layout);

}  // namespace cairn::sim
