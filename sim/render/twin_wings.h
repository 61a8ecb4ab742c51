#pragma once

#include "sim/render/layout.h"

namespace cairn::sim {

// Two corridors that look alike, so that only images of the places where they differ tell one from the other.
//
//      +---+      +---+      +----------+      wing 1 is wing 0, moved along x, with all textures of the wing
//      | w |      | w |      |          |      and of the spine that is seen from it (Layout::twins), except
//      | i |      | i |      |   goal   |      num_different_panels of its wall panels
//      | n |      | n |      |          |
//      | g |      | g |      |          |
//      | 0 |      | 1 |      +---- -----+
//      |   +------+   +------+          |
//      |            spine               |
//      +--------------------------------+
//
// With back_corridor the wings and the goal room do not end at the building's wall but open to a corridor
// like the spine, so that three ways lead there.  num_rooms and extra_door_ratio are not used.  There is
// furniture in the goal room only.  Errors: InvalidArgument when this does not fit into width_m and depth_m;
// says what does.
Result<Layout> MakeTwinLayout(const SimulateOptions& options);

}  // namespace cairn::sim
