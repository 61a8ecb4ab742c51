#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "sim/render/layout.h"

namespace cairn::sim {

// Adds cabinets, tables, boxes and pillars to the rooms of a layout, up to furniture_ratio of each room's
// floor.  A piece is placed only where the rest of the room stays in one part for a camera that keeps
// clearance_m, doors included.
void PlaceFurniture(const SimulateOptions& options, uint64_t seed, Layout* layout);

// Another place for a piece of furniture in its room, turned as it is and off its old place, on the same
// terms; at a wall where it stands at one.  Nothing where none is found, or the piece is in no room.
std::optional<Rect> PlaceElsewhere(const SimulateOptions& options, const Layout& layout, size_t piece,
                                   uint64_t seed);

}  // namespace cairn::sim
