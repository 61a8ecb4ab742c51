#pragma once

#include <vector>

#include "core/blocks/map_rows.h"
#include "core/geometry/pose.h"

namespace cairn {

// cam_from_world of the nodes of the map's promise, in their order.  REQUIRES: rows.findings.promise
std::vector<Pose> NodePoses(const MapRows& rows);

}  // namespace cairn
