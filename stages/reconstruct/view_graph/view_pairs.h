#pragma once

#include <map>
#include <vector>

#include "core/base/progress.h"
#include "core/camera/camera.h"
#include "core/geometry/pose.h"
#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// Two images that show the same things: how the second camera stands to the first.
struct ViewPair {
  int image1 = 0, image2 = 0;  // indices into MapperInput::images
  Pose cam2_from_cam1;         // its translation is a direction, of length 1
  // Others that explain the matches as well: points on a plane leave two.
  std::vector<Pose> alternatives;
  std::vector<Match> matches;  // those that it explains
  // How much of what the images show both do: matches over the keypoints that have any, of the image with
  // more.
  double strength = 0;
  // How well other pairs bear it out (triangles.h); 1 where that was not asked.
  double closed = 1;
  double weight = 0;  // beside pairs that contradict it
};

// Takes the one of the relative poses whose rotation is nearest to this.
void ChooseRotation(const Eigen::Quaterniond& cam2_from_cam1, ViewPair* pair);

struct ViewPairOptions {
  // Largest distance of a match to its epipolar line, pixels.  REQUIRES: > 0
  double max_epipolar_error_px = 4;
  // Fewest matches of a pair.  REQUIRES: >= 5
  int min_num_matches = 15;
};

// The relative pose of each verified pair by these cameras: from its essential or fundamental matrix, or by
// five points where it has none, refined; of points on a plane also the others, the one of the smallest turn
// first.  Pairs that keep too few matches are left out; in the order of the pairs.  Same result for any
// number of threads; what was done so far when progress is cancelled.
std::vector<ViewPair> EstimateViewPairs(const MapperInput& input, const std::map<CameraId, Camera>& cameras,
                                        const ViewPairOptions& options, int num_threads, Progress& progress);

}  // namespace cairn::reconstruct
