#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/base/ids.h"
#include "stages/reconstruct/view_graph/image_motion.h"
#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {

// From one image's centre to another's, in the world's frame.
struct Way {
  int from = 0, to = 0;
  Eigen::Vector3d way = Eigen::Vector3d::Zero();
  double sigma = 1;   // per axis
  double weight = 1;  // beside ways that contradict it
};

// Where a keypoint is seen, a unit vector in its camera's frame; none outside of what the lens shows.
using BearingOf = std::function<std::optional<Eigen::Vector3d>(int image, KeypointIdx keypoint)>;

// Ways by pairs, whose lengths are averaged, and by motions, in metres if there are any; of pairs that know
// no length, and of `steps` (images of which one follows the other), that they are short.  `sigma_rad`: of
// bearings.  `weigh_by_matches`: a way counts by its pair's matches beside those that contradict it, as
// look-alikes do, of which there may be as many.  Same result for any number of threads.
std::vector<Way> WaysBy(const std::vector<Eigen::Quaterniond>& rotations, const std::vector<ViewPair>& pairs,
                        const std::vector<ImageMotion>& motions,
                        const std::vector<std::pair<int, int>>& steps, const BearingOf& bearing_of,
                        double sigma_rad, bool weigh_by_matches, int num_threads);

// The images' centres that explain the ways best, robustly; the first at zero.  REQUIRES: the ways join all
// images
std::vector<Eigen::Vector3d> CentersAlong(int num_images, const std::vector<Way>& ways);

// How long steps are at these places.
std::vector<double> StepLengths(const std::vector<Eigen::Vector3d>& centers,
                                const std::vector<std::pair<int, int>>& steps);

// One that three quarters are not longer than: images may turn on the spot in many.  REQUIRES: a length
double TypicalLength(const std::vector<double>& lengths);

// Whether a drive that has come to these places is torn: a step is more than five times as long as a typical
// one.  Right maps of drives and films have steps of at most 3.8 typical ones, torn ones of 6 to 24.
bool IsTorn(const std::vector<Eigen::Vector3d>& centers, const std::vector<std::pair<int, int>>& steps);

// Whether a drive whose images are moved from places to others is torn in more steps than it was; by what is
// typical of it before.
bool IsTornMore(const std::vector<Eigen::Vector3d>& centers, const std::vector<Eigen::Vector3d>& moved,
                const std::vector<std::pair<int, int>>& steps);

// The ways, and the steps as they are at these places, in the unit of the ways: they hold what few ways join,
// and give way to what more say.
std::vector<Way> WithStepsOf(const std::vector<Eigen::Vector3d>& centers,
                             const std::vector<std::pair<int, int>>& steps, std::vector<Way> ways);

}  // namespace cairn::reconstruct
