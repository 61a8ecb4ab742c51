#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "runtime/visual_map/visual_estimate.h"

namespace cairn {

// p(x | z) over the survey's places for one image [Sala06 Fig. 15]: the darker, the likelier, tenfold less
// being one step lighter; a cross where the image was taken, a circle at the maximum.  Axes in metres, and
// a legend.
std::string PosteriorSvg(const std::string& title, const VisualMap& map, const VisualPose& pose,
                         const Eigen::Vector2d& truth);

// Arrows from where images were taken to where they were placed [Sala06 Fig. 16], longer than the floor's
// scale where errors are small, as the legend says; flagged ones, which claim no place, as rings.
struct ErrorArrow {
  Eigen::Vector2d truth, found;
  bool is_flagged = false;
};
std::string ErrorSvg(const std::string& title, const VisualMap& map, const std::vector<ErrorArrow>& arrows);

}  // namespace cairn
