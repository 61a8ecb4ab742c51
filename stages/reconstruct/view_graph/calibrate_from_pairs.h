#pragma once

#include <map>

#include <Eigen/Core>

#include "core/camera/camera.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// Of a focal length and a principal point, pixels.
Eigen::Matrix3d CalibrationMatrix(double focal, const Eigen::Vector2d& centre);

// How badly two focal lengths, pixels, fit a fundamental matrix of pixels of two cameras: 0 where the two
// singular values of the essential matrix are equal, and hardly more for what is far off than for what is
// off.
double FocalCost(const Eigen::Matrix3d& F, const Camera& camera1, double focal1, const Camera& camera2,
                 double focal2);

// Whether a pair's fundamental matrix says anything about focal lengths.
bool TellsFocalLengths(const TwoViewGeometry& geometry);

// The `i`-th of kNumLadderFocals focal lengths from 0.3 to 4 times the image's longer side, evenly in the
// logarithm, pixels; also between two of them.
inline constexpr int kNumLadderFocals = 81;
double FocalOfLadder(const Camera& camera, double i);

// Focal lengths of cameras that have none but a guess, from fundamental matrices: with the right ones an
// essential matrix's two singular values are equal [Fetzer, Reis & Stricker 2020, "Stable intrinsic
// auto-calibration from fundamental matrices of devices with uncorrelated camera parameters"; as in Pan et
// al. 2024, GLOMAP, §3.2].  Per camera, the one of a ladder from 0.3 to 4 times the image's longer side that
// most pairs agree on, refined; a pair whose motion says nothing about it has no say.  Cameras with a stated
// focal length stay.  O(pairs * steps).
std::map<CameraId, Camera> CalibrateFromPairs(const MapperInput& input);

}  // namespace cairn::reconstruct
