#include "core/promise/expectation.h"

#include <cmath>

#include "core/promise/pose_information.h"

namespace cairn {

Expectation ExpectationOf(const LandmarkSights& sights, const std::vector<ClassMatch>& matches,
                          const std::vector<char>& keep, const Pose& cam_from_world, double focal,
                          double depth) {
  Expectation expected;
  PoseInformation information = PoseInformation::Rough(1, depth);
  std::vector<SightInformation> seen;
  for (const ClassMatch& match : matches) {
    if (keep[match.i] == 0) continue;
    expected.num_matches += match.probability;
    if (const auto root = sights.Root(match.i, cam_from_world, focal, match.probability))
      seen.push_back({0, *root});
  }
  information.Add(seen);
  expected.sigma_m = std::sqrt(information.PlaceVariance(0));
  return expected;
}

}  // namespace cairn
