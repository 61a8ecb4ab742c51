#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"

namespace cairn::decompose_views {

// Whether rings (outer ones counter-clockwise, each followed by its clockwise holes) are valid polygons whose
// interiors do not overlap, after GEOS.
// Errors: Corrupt: what is wrong and where, in metres.
Status CheckRings(const std::vector<std::vector<Eigen::Vector2d>>& rings);

}  // namespace cairn::decompose_views
