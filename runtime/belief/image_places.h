#pragma once

#include <vector>

#include "core/geometry/planar_pose.h"
#include "runtime/belief/pose_belief.h"
#include "runtime/localize/localization.h"

namespace cairn {

struct MapHead;  // core/blocks/map_head.h

// Where an image says that a robot stands: at its fix, or at one of the places that look alike.  The robot is
// at `robot_in_camera` in the camera's frame on the floor (x the way that it looks, y to the left, metres).
// Of possible poses without a covariance 0.3 m and 5 degrees are assumed. None where the image says nothing.
// `head`: of the map that localized it.
std::vector<PossiblePlace> PlacesOf(const Localization& found, const MapHead& head,
                                    const PlanarPose& robot_in_camera);

}  // namespace cairn
