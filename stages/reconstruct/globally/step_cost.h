#pragma once

#include <algorithm>

#include <ceres/ceres.h>
#include <Eigen/Core>

namespace cairn::reconstruct {

// How far two centres are apart, against a typical step of a drive: weight * (length / step - 1).
class StepCost : public ceres::SizedCostFunction<1, 3, 3> {
 public:
  StepCost(double step, double weight) : step_(step), weight_(weight) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector3d> from(parameters[0]), to(parameters[1]);
    const Eigen::Vector3d way = to - from;
    const double length = way.norm();
    residuals[0] = weight_ * (length / step_ - 1);
    if (jacobians == nullptr) return true;
    const Eigen::Vector3d slope =
        length > 0 ? Eigen::Vector3d(way * (weight_ / (length * step_))) : Eigen::Vector3d::Zero();
    for (int side = 0; side < 2; ++side) {
      if (jacobians[side] == nullptr) continue;
      for (int k = 0; k < 3; ++k) jacobians[side][k] = side == 0 ? -slope[k] : slope[k];
    }
    return true;
  }

 private:
  double step_, weight_;
};

}  // namespace cairn::reconstruct
