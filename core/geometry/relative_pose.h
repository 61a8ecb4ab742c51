#pragma once

#include <Eigen/Core>

#include "core/geometry/pose.h"
#include "core/geometry/two_view_error.h"

namespace cairn {

// E = [t / |t|]x R, with b2' E b1 = 0 for the bearings of one point.
Eigen::Matrix3d EssentialMatrix(const Pose& cam2_from_cam1);

// Refines rotation and direction of the translation (length 1) so that the sum over the correspondences of
// the Cauchy cost of the Sampson error is least: iteratively reweighted Gauss-Newton, `num_iterations` steps
// with an inlier scale of `scale_rad`.  The start must be near.  O(correspondences).
Pose RefineRelativePose(const Pose& cam2_from_cam1, const Correspondences& correspondences, double scale_rad,
                        int num_iterations);

// The rotation that takes bearings of camera 1 to those of camera 2, refined from a near start with Cauchy
// weights of `scale_rad` [Kabsch 1976, weighted].
Eigen::Quaterniond RefineRotation(const Eigen::Quaterniond& cam2_from_cam1,
                                  const Correspondences& correspondences, double scale_rad,
                                  int num_iterations);

// The one of the four poses behind an essential matrix that puts most correspondences in front of both
// cameras [Hartley & Zisserman 2004, 9.6.3]; translation of length 1.
Pose PoseFromEssentialMatrix(const Eigen::Matrix3d& E, const Correspondences& correspondences);

}  // namespace cairn
