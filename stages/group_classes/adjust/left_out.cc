#include "stages/group_classes/adjust/left_out.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::group_classes {
namespace {

// Points were placed by all keypoints: what has not converged still knows those that are left out, and more
// of it where poses hardly move than where they go back to what was stated.  With the tolerance of learning
// (1e-3) 3000 exact poses seemed 2 % worse than adjusted ones.
constexpr double kTolerance = 1e-6;

}  // namespace

LeftOutErrors LeaveOut(const BundleOptions& options, BundleProblem problem) {
  // One keypoint of each track of four or more.
  std::vector<BundleProblem::Observation> kept, left_out;
  for (size_t begin = 0; begin < problem.observations.size();) {
    size_t end = begin;
    while (end < problem.observations.size() &&
           problem.observations[end].point_idx == problem.observations[begin].point_idx)
      ++end;
    const size_t out =
        end - begin >= 4 ? begin + static_cast<size_t>(problem.observations[begin].point_idx) % (end - begin)
                         : end;
    for (size_t i = begin; i < end; ++i)
      (i == out ? left_out : kept).push_back(std::move(problem.observations[i]));
    begin = end;
  }
  problem.observations = std::move(kept);
  BundleOptions converged = options;
  converged.function_tolerance = kTolerance;
  AdjustBundle(converged, &problem, nullptr);
  LeftOutErrors errors(problem.images.size(), 0);
  constexpr double kMaxSquare = 16;
  for (const BundleProblem::Observation& observation : left_out) {
    const double whitened =
        ResidualOf(problem, observation).squaredNorm() / (observation.sigma_px * observation.sigma_px);
    errors[observation.image_idx] += std::min(whitened, kMaxSquare);
  }
  return errors;
}

LeftOutGain GainOf(const BundleProblem& problem, const LeftOutErrors& before, const LeftOutErrors& after,
                   int camera_idx) {
  double sum_before = 0, sum_difference = 0, sum_squares = 0;
  for (size_t i = 0; i < problem.images.size(); ++i) {
    if (camera_idx >= 0 && problem.images[i].camera_idx != camera_idx) continue;
    const double difference = before[i] - after[i];
    sum_before += before[i];
    sum_difference += difference;
    sum_squares += difference * difference;
  }
  if (!(sum_before > 0)) return {};
  return {sum_difference / sum_before, std::sqrt(sum_squares) / sum_before};
}

}  // namespace cairn::group_classes
