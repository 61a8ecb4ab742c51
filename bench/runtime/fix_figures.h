#pragma once

#include <algorithm>
#include <ctime>
#include <vector>

#include "runtime/localize/localization.h"
#include "runtime/localize/refine.h"

namespace cairn {

inline double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

inline double QuantileOf(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(part * static_cast<double>(values.size() - 1))];
}

// How fixes err.
struct FixFigures {
  int num_images = 0, num_fixes = 0, num_wrong = 0;
  double num_features = 0, num_inliers = 0;
  // Of each fix; the last is the error squared over its covariance, of 6 degrees of freedom.
  std::vector<double> errors_m, errors_deg, errors_squared;

  void Add(const Localization& found, const Pose& truth) {
    ++num_images;
    num_features += found.num_features;
    if (!found.has_fix()) return;
    ++num_fixes;
    num_inliers += found.num_inliers;
    errors_m.push_back(CenterErrorM(found.cam_from_world, truth));
    errors_deg.push_back(RotationErrorDeg(found.cam_from_world, truth));
    const Vector6d error = PerturbationBetween(found.cam_from_world, truth);
    errors_squared.push_back(error.dot(found.covariance.ldlt().solve(error)));
    num_wrong += errors_m.back() > 0.5 || errors_deg.back() > 10 ? 1 : 0;
  }
};

}  // namespace cairn
