#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/ids.h"
#include "core/camera/pixel_ray.h"
#include "core/geometry/pose.h"
#include "stages/reconstruct/registration/posed_input.h"

namespace cairn::reconstruct {

// A keypoint of an image without a pose, and a point that posed images see, which may be what it shows.
struct PointMatch {
  PixelRay ray;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world frame
};

// Where an image may be, and how many of its matches agree.
struct FixedPose {
  Pose cam_from_world;
  int num_inliers = 0;
};

// Where an image is by what it sees of posed ones alone.
struct ImageFix {
  int image = 0;
  std::vector<PointMatch> matches;
  // The pose that most matches agree with, and that of most of the others; none, one or two.
  std::vector<FixedPose> poses;

  int num_inliers() const { return poses.empty() ? 0 : poses[0].num_inliers; }
};

// Of each of `images`.  A keypoint that matches keypoints of several points has up to three, those that most
// posed images have first: places that look alike.  Poses by the robot's estimator
// (runtime/localize/estimate.h). The same for any number of threads.
std::vector<ImageFix> FixImages(const PosedInput& posed, const SeenPoints& seen,
                                const std::vector<int>& images, double max_error_px, int num_threads);

}  // namespace cairn::reconstruct
