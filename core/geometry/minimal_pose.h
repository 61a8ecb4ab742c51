#pragma once

#include <array>
#include <cassert>
#include <cstddef>

#include <Eigen/Core>

#include "core/geometry/pose.h"

namespace cairn {

// What one of a rig's cameras sees: a ray in the rig's frame, metres, of unit direction.
struct RigRay {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

// A list of few elements, in place: no memory is asked for.
template <typename T, size_t MaxNum>
class ShortList {
 public:
  // REQUIRES: fewer than MaxNum
  void push_back(const T& value) {
    assert(num_ < MaxNum);
    values_[num_++] = value;
  }
  size_t size() const { return num_; }
  bool empty() const { return num_ == 0; }
  const T& operator[](size_t i) const { return values_[i]; }
  T* begin() { return values_.data(); }
  T* end() { return values_.data() + num_; }
  const T* begin() const { return values_.data(); }
  const T* end() const { return values_.data() + num_; }

 private:
  std::array<T, MaxNum> values_{};
  size_t num_ = 0;
};
using MinimalPoses = ShortList<Pose, 8>;

// The rig_from_world that put three points on these rays, ahead of their origins: at most 8 (generalised P3P:
// Nister & Stewenius, "A minimal solution to the generalised 3-point pose problem", 2007; here by the
// resultant of the three distances' equations).  None where the rays do not determine it: parallel ones, or
// points in a line.
MinimalPoses PosesFromThreeRays(const std::array<RigRay, 3>& rays,
                                const std::array<Eigen::Vector3d, 3>& points);

// The same of two points and a direction that is known in both frames, up say, of length 1 in each: at most 2
// (Kukelova, Bujnak, Pajdla, "Closed-form solutions to minimal absolute pose problems with known vertical
// direction", 2010).  Two points on the horizon do not determine it.
MinimalPoses PosesFromTwoRays(const std::array<RigRay, 2>& rays, const std::array<Eigen::Vector3d, 2>& points,
                              const Eigen::Vector3d& up_in_rig, const Eigen::Vector3d& up_in_world);

}  // namespace cairn
