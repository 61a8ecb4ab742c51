#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

namespace cairn {

// Lens distortion as a map of a plane: of (x/z, y/z), or for fisheye models of the angle from the axis (rad)
// times its direction.  All of COLMAP's polynomial models are cases of it:
//
//   D(a) = radial(t) a + | 2 p1 x y + p2 (t + 2 x^2) + sx t |        a = (x, y),  t = |a|^2
//                        | 2 p2 x y + p1 (t + 2 y^2) + sy t |
//   radial(t) = (1 + n1 t + n2 t^2 + n3 t^3 + n4 t^4) / (1 + d1 t + d2 t^2 + d3 t^3)
//
// Such polynomials fold: beyond some radius farther rays come back into the image.  The map is used up to the
// fold only, where it is one to one.
struct DistortionCoefficients {
  std::array<double, 5> numerator = {1, 0, 0, 0, 0};
  std::array<double, 4> denominator = {1, 0, 0, 0};
  double p1 = 0, p2 = 0;  // decentering
  double sx = 0, sy = 0;  // thin prism
};

class Distortion {
 public:
  // max_radius: largest |a| that means anything (pi for an angle).
  Distortion(const DistortionCoefficients& coefficients, double max_radius);

  // D(a); nothing at and beyond the fold, where |a| exceeds max_radius, or for NaN.
  std::optional<Eigen::Vector2d> Apply(const Eigen::Vector2d& a) const;

  // The a before the fold with D(a) = distorted: |D(a) - distorted| <= 1e-12 (1 + |distorted|).  Newton's
  // method, bracketed along the radius, damped in the plane.  Nothing where there is none.
  std::optional<Eigen::Vector2d> Invert(const Eigen::Vector2d& distorted) const;

 private:
  // Degree of the polynomial whose sign is that of d(radius of the image) / d(radius).
  static constexpr int kSlopeDegree = 7;

  double Radial(double t) const;
  double RadialDerivative(double t) const;  // d radial / d t
  Eigen::Vector2d Map(const Eigen::Vector2d& a) const;
  Eigen::Matrix2d Jacobian(const Eigen::Vector2d& a) const;
  bool IsMonotoneTo(double radius) const;
  bool IsBeforeFold(const Eigen::Vector2d& a) const;
  std::optional<double> InvertRadius(double distorted, double* nearest) const;

  DistortionCoefficients c_;
  double max_radius_;
  bool is_radial_;
  bool is_polynomial_;
  std::array<double, kSlopeDegree + 1> slope_{};  // in t, lowest power first
};

}  // namespace cairn
