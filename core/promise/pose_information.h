#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/pose.h"
#include "core/world/feature_class.h"

namespace cairn {

// What bearings tell about a camera's pose (left perturbation of cam_from_world: rotation in rad, translation
// in m).  A landmark l seen from view v, at Y in the camera's frame, by a bearing u = Y / |Y|:
//   I_lv = p_l J' S^-1 J    J = B' [-[Y]x | 1] / |Y|         Y in metres
//                           S = s^2 1 + B' C B / |Y|^2       s = keypoint's error, rad; C = covariance of l
//                                                            in the camera's frame, m^2; B = two unit vectors
//                                                            at right angles to u and to each other
//                           p_l = probability that l is matched, in [0, 1]
struct SightInformation {
  size_t view = 0;
  Eigen::Matrix<double, 2, 6> root;  // I_lv = root' root
};

// sqrt(p_l) S^(-1/2) J, up to a rotation of its rows.  Nothing where the landmark lies at the camera's own
// centre.  `keypoint_sigma_rad`: s.
std::optional<Eigen::Matrix<double, 2, 6>> InformationRoot(const FeatureClass& feature_class,
                                                           const Pose& cam_from_world,
                                                           double keypoint_sigma_rad, double probability);

// The information that the landmarks taken so far give each view about its pose: A_v = A_0 + sum of I_lv.
class PoseInformation {
 public:
  // A_0, what is known without landmarks: standard deviation of the camera's place, m, and of its
  // rotation, degrees.  REQUIRES: > 0
  PoseInformation(size_t num_views, double rough_sigma_m, double rough_sigma_deg);

  // Without landmarks a robot knows its place to half the distance of what it sees, and its rotation to 30
  // degrees.
  static PoseInformation Rough(size_t num_views, double depth);

  // What a landmark would add to the sum over views of log det A_v; >= 0.
  double DeterminantGain(const std::vector<SightInformation>& sights) const;
  // The part of the trace of the place's covariance in its view that one sight of it would leave; in (0, 1].
  double PlaceRatio(size_t view, const Eigen::Matrix<double, 2, 6>& root) const;
  void Add(const std::vector<SightInformation>& sights);
  // Trace of the covariance of the camera's place, m^2.
  double PlaceVariance(size_t view) const;

 private:
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  std::vector<Matrix6d> covariances_;  // per view, the inverse of A_v
};

}  // namespace cairn
