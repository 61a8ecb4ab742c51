#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "runtime/visual_map/visual_search.h"

namespace cairn {

// A maximum of p(x | z) between the survey's places.
struct DensityMaximum {
  VisualHypothesis start;  // the point that it was found from
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  Turn turn;
  double log_density = 0;  // there, unnormalised: ln p(z | x) p(turn)
  // ln of its integral over places, turns and heights by Laplace, in the measure of
  // VisualHypothesis's log_mass.
  double log_mass = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // x m, y m, heading rad
  std::vector<int> agreeing;                             // matches
};

// Gauss-Newton over place, turn and height with the models themselves, from a point that `search` has found.
// Nothing where the matches do not determine a pose.
std::optional<DensityMaximum> RefinePose(const VisualMap& map, const VisualSearch& search,
                                         const VisualHypothesis& start);

}  // namespace cairn
