#pragma once

#include <string>
#include <vector>

#include "core/geometry/pose.h"
#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {

// What odometry says of two images of which one follows the other.
struct ImageMotion {
  int image1 = 0, image2 = 0;  // indices into MapperInput::images
  Pose cam2_from_cam1;         // metres

  // From the first camera's centre to the second's, in the first's frame, metres.
  Eigen::Vector3d Way() const { return cam2_from_cam1.Center(); }
};

// Median length, metres; 0: there is none.
double MedianWayM(const std::vector<ImageMotion>& motions);

// Leaves out jumps: motions that turn otherwise than images that share enough matches, or go much farther
// than others.  Where most do, or
// where most go in another direction, all are left out: the odometry is not the camera's.  Returns a sentence
// about that, else nothing.  `pairs`: of the same indices.
std::string LeaveOutContradicted(const std::vector<ViewPair>& pairs, std::vector<ImageMotion>* motions);

// The motions as pairs without matches, which have less weight than pairs of images that share enough.
std::vector<ViewPair> PairsOf(const std::vector<ImageMotion>& motions);

}  // namespace cairn::reconstruct
