#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/pose.h"
#include "core/geometry/two_view_error.h"

namespace cairn {

// Models of two views from matches alone, all but the eight-point one through OpenCV's USAC (MAGSAC++ scores
// [Barath20], local optimisation), with a fixed seed: same matches, same model.  They act on bearings, up to
// scale: b2' M b1 = 0, b2 ~ H b1.  Samples are drawn from the matches whose bearings lie within 60 degrees of
// both optical axes, where perspective coordinates still have usable errors; callers count inliers and refine
// over all matches.  Returns nothing for too few or degenerate matches (all on a line, all the same).
struct EstimateModelOptions {
  double max_error_rad = 0;
  int max_num_iterations = 5000;
};

// Five points, known intrinsics [Nister04].
std::optional<Eigen::Matrix3d> EstimateEssentialMatrix(const Correspondences& correspondences,
                                                       const EstimateModelOptions& options);
// Seven points, intrinsics unknown: bearings stand for pixels of a camera whose focal length is a guess.
std::optional<Eigen::Matrix3d> EstimateFundamentalMatrix(const Correspondences& correspondences,
                                                         const EstimateModelOptions& options);
// Eight points in plain RANSAC, normalised [Hartley97], estimated again from the inliers: the standard
// reconstruction of [Booij06 §III].  Of an essential matrix if `is_essential`: its two singular values are
// made equal.
std::optional<Eigen::Matrix3d> EstimateByEightPoints(const Correspondences& correspondences,
                                                     bool is_essential, const EstimateModelOptions& options);
// Four points: a plane, or a camera that only turned.  Its sign is such that it takes most bearings to
// the front.
std::optional<Eigen::Matrix3d> EstimateHomography(const Correspondences& correspondences,
                                                  const EstimateModelOptions& options);

// The relative poses, up to four, that a homography of bearings may come from; translations of length 1 and
// either sign [Malis & Vargas 2007].  None of a rotation.
std::vector<Pose> PosesFromHomography(const Eigen::Matrix3d& H);

}  // namespace cairn
