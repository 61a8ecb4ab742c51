#pragma once

#include <vector>

#include <Eigen/Core>

namespace cairn::reconstruct {

// Places of cameras, in a world whose z is up, as a picture shows them: from above, with the world's x and y.
// Where that hides how far they are apart (along a wall on which they stand one above the other, or where all
// look down, so that `up` was taken for a level direction), the plane that they are nearest to, with its
// longer direction as x.
std::vector<Eigen::Vector2d> SeenFromAbove(const std::vector<Eigen::Vector3d>& centres);

}  // namespace cairn::reconstruct
