#include "core/geometry/minimal_pose.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Dense>

namespace cairn {
namespace {

constexpr int kMaxDegree = 8;
using Polynomial = Eigen::Matrix<double, kMaxDegree + 1, 1>;  // coefficients, the constant first

Polynomial MakePolynomial(double constant, double linear = 0, double quadratic = 0) {
  Polynomial polynomial = Polynomial::Zero();
  polynomial.head<3>() << constant, linear, quadratic;
  return polynomial;
}

// REQUIRES: the product's degree is at most kMaxDegree
Polynomial Times(const Polynomial& a, const Polynomial& b) {
  Polynomial product = Polynomial::Zero();
  for (int i = 0; i <= kMaxDegree; ++i) product.tail(kMaxDegree + 1 - i) += a[i] * b.head(kMaxDegree + 1 - i);
  return product;
}

double ValueAt(const Polynomial& polynomial, int degree, double x) {
  double value = polynomial[degree];
  for (int i = degree - 1; i >= 0; --i) value = value * x + polynomial[i];
  return value;
}

struct Roots {
  std::array<double, 2 * kMaxDegree> x;
  int num = 0;
  void Add(double root) { x[num++] = root; }
};

// The root between two places where the values' signs differ: Newton's steps, halves where one leads out.
double RootBetween(const Polynomial& polynomial, const Polynomial& derivative, int degree, double low,
                   double high) {
  const bool is_rising = ValueAt(polynomial, degree, low) < 0;
  double x = 0.5 * (low + high);
  constexpr int kMaxSteps = 100;
  for (int step = 0; step < kMaxSteps; ++step) {
    const double value = ValueAt(polynomial, degree, x);
    if (value == 0) break;
    ((value < 0) == is_rising ? low : high) = x;
    double next = x - value / ValueAt(derivative, degree - 1, x);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - x) <= 1e-15 * std::abs(x)) break;
    x = next;
  }
  return x;
}

// Where it changes its sign between two places, ascending: once at most between two of its derivative's
// roots, `turns`.
Roots RootsBetween(const Polynomial& polynomial, int degree, double low, double high,
                   Roots* turns = nullptr) {
  Roots roots;
  if (degree < 1) return roots;
  Polynomial derivative = Polynomial::Zero();
  for (int i = 1; i <= degree; ++i) derivative[i - 1] = i * polynomial[i];
  Roots ends = RootsBetween(derivative, degree - 1, low, high);
  if (turns != nullptr) *turns = ends;
  ends.Add(high);
  for (int i = 0; i < ends.num; ++i) {
    const double from = i == 0 ? low : ends.x[i - 1];
    if ((ValueAt(polynomial, degree, from) < 0) != (ValueAt(polynomial, degree, ends.x[i]) < 0))
      roots.Add(RootBetween(polynomial, derivative, degree, from, ends.x[i]));
  }
  return roots;
}

// |(o1 + x d1) - (o2 + y d2)|^2 - distance^2 as a polynomial of both depths:
// x^2 + y^2 + xy x y + x1 x + y1 y + constant.
struct DistanceEquation {
  double xy = 0, x1 = 0, y1 = 0, constant = 0;

  DistanceEquation(const RigRay& a, const RigRay& b, double squared_distance) {
    const Eigen::Vector3d offset = a.origin - b.origin;
    xy = -2 * a.direction.dot(b.direction);
    x1 = 2 * a.direction.dot(offset);
    y1 = -2 * b.direction.dot(offset);
    constant = offset.squaredNorm() - squared_distance;
  }
  double At(double x, double y) const { return x * x + y * y + xy * x * y + x1 * x + y1 * y + constant; }
  double DerivativeX(double x, double y) const { return 2 * x + xy * y + x1; }
  double DerivativeY(double x, double y) const { return 2 * y + xy * x + y1; }
};

// The depths of three rays whose ends are so far apart.
class ThreeDepths {
 public:
  ThreeDepths(const std::array<RigRay, 3>& rays, const std::array<Eigen::Vector3d, 3>& points)
      : xy_(rays[0], rays[1], (points[0] - points[1]).squaredNorm()),
        xz_(rays[0], rays[2], (points[0] - points[2]).squaredNorm()),
        yz_(rays[1], rays[2], (points[1] - points[2]).squaredNorm()),
        least_squared_(std::min({(points[0] - points[1]).squaredNorm(), (points[0] - points[2]).squaredNorm(),
                                 (points[1] - points[2]).squaredNorm()})) {}

  ShortList<Eigen::Vector3d, kMaxDegree> Solve() const {
    // With x fixed: y^2 + b1 y + c1 = 0, z^2 + b2 z + c2 = 0.
    const Polynomial b1 = MakePolynomial(xy_.y1, xy_.xy), c1 = MakePolynomial(xy_.constant, xy_.x1, 1);
    const Polynomial b2 = MakePolynomial(xz_.y1, xz_.xy), c2 = MakePolynomial(xz_.constant, xz_.x1, 1);
    // The third with y^2 and z^2 from these: (A z + B) y + (C z + D) = 0.
    const double A = yz_.xy;
    const Polynomial B = MakePolynomial(yz_.x1) - b1, C = MakePolynomial(yz_.y1) - b2;
    const Polynomial D = MakePolynomial(yz_.constant) - c1 - c2;
    // y from there into the first: n2 z^2 + n1 z + n0 = 0, and z^2 from the second: E z + F = 0.
    const Polynomial n2 = Times(C, C) - A * Times(b1, C) + A * A * c1;
    const Polynomial n1 = 2 * Times(C, D) - Times(b1, A * D + Times(B, C)) + 2 * A * Times(c1, B);
    const Polynomial n0 = Times(D, D) - Times(b1, Times(B, D)) + Times(c1, Times(B, B));
    const Polynomial E = n1 - Times(b2, n2), F = n0 - Times(c2, n2);
    // And z from there into the second.
    const Polynomial resultant = Times(F, F) - Times(b2, Times(E, F)) + Times(c2, Times(E, E));

    int degree = kMaxDegree;
    const double largest = resultant.cwiseAbs().maxCoeff();
    constexpr double kNothing = 1e-14;
    while (degree > 0 && std::abs(resultant[degree]) <= kNothing * largest) --degree;
    if (degree == 0) return {};
    // [Cauchy] no root is larger.
    const double bound = 1 + largest / std::abs(resultant[degree]);
    Roots turns;
    Roots starts = RootsBetween(resultant, degree, 0, bound, &turns);
    // And where it turns near zero: of two roots that are nearly one, rounding leaves no change of sign.
    const Polynomial magnitudes = resultant.cwiseAbs();
    for (int i = 0; i < turns.num; ++i) {
      constexpr double kNearZero = 1e-5;  // of the sum of its terms
      if (std::abs(ValueAt(resultant, degree, turns.x[i])) <=
          kNearZero * ValueAt(magnitudes, degree, turns.x[i]))
        starts.Add(turns.x[i]);
    }
    ShortList<Eigen::Vector3d, kMaxDegree> depths;
    const auto polish = [&](const Eigen::Vector3d& start) {
      const std::optional<Eigen::Vector3d> found = Polished(start);
      constexpr double kSame = 1e-7;
      const bool is_new = found && std::none_of(depths.begin(), depths.end(), [&](const auto& known) {
                            return (known - *found).norm() <= kSame * found->norm();
                          });
      if (is_new && depths.size() < kMaxDegree) depths.push_back(*found);
      return is_new;
    };
    for (int i = 0; i < starts.num; ++i) {
      const double x = starts.x[i];
      if (polish(DepthsAt(x))) continue;
      // By what eliminated them.
      const double z = -ValueAt(F, kMaxDegree, x) / ValueAt(E, kMaxDegree, x);
      polish({x, -(ValueAt(C, 1, x) * z + ValueAt(D, 2, x)) / (A * z + ValueAt(B, 1, x)), z});
    }
    return depths;
  }

 private:
  // With this first depth, of the two others that the first two distances allow, those which the third fits
  // best.
  Eigen::Vector3d DepthsAt(double x) const {
    const auto seconds = [&](const DistanceEquation& equation) {
      const double half_linear = 0.5 * (equation.xy * x + equation.y1);
      const double constant = x * x + equation.x1 * x + equation.constant;
      const double root = std::sqrt(std::max(0.0, half_linear * half_linear - constant));
      return std::array<double, 2>{-half_linear - root, -half_linear + root};
    };
    Eigen::Vector3d best(x, 0, 0);
    double least = std::numeric_limits<double>::infinity();
    for (const double y : seconds(xy_)) {
      for (const double z : seconds(xz_)) {
        const double error = std::abs(yz_.At(y, z));
        if (!(error < least)) continue;
        least = error;
        best = {x, y, z};
      }
    }
    return best;
  }

  // By Newton's steps on the three distances; nothing where they lead nowhere, or behind an origin.
  std::optional<Eigen::Vector3d> Polished(Eigen::Vector3d depths) const {
    constexpr double kLargestError = 1e-8;  // of the least of the squared distances
    constexpr int kNumSteps = 12;
    Eigen::Vector3d errors;
    for (int step = 0;; ++step) {
      const double x = depths.x(), y = depths.y(), z = depths.z();
      errors << xy_.At(x, y), xz_.At(x, z), yz_.At(y, z);
      if (step == kNumSteps || errors.cwiseAbs().maxCoeff() <= 1e-4 * kLargestError * least_squared_) break;
      Eigen::Matrix3d jacobian;
      jacobian << xy_.DerivativeX(x, y), xy_.DerivativeY(x, y), 0,  //
          xz_.DerivativeX(x, z), 0, xz_.DerivativeY(x, z),          //
          0, yz_.DerivativeX(y, z), yz_.DerivativeY(y, z);
      depths -= jacobian.partialPivLu().solve(errors);
    }
    const bool is_solved = errors.cwiseAbs().maxCoeff() <= kLargestError * least_squared_;
    if (!is_solved || !(depths.minCoeff() > 0)) return std::nullopt;  // NaN: neither
    return depths;
  }

  DistanceEquation xy_, xz_, yz_;
  double least_squared_;
};

// Axes of the triangle of three points: columns.
Eigen::Matrix3d Axes(const std::array<Eigen::Vector3d, 3>& points) {
  Eigen::Matrix3d axes;
  axes.col(0) = (points[1] - points[0]).normalized();
  axes.col(2) = axes.col(0).cross(points[2] - points[0]).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

Eigen::Matrix3d LevelFrom(const Eigen::Vector3d& up) {
  return Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

}  // namespace

MinimalPoses PosesFromThreeRays(const std::array<RigRay, 3>& rays,
                                const std::array<Eigen::Vector3d, 3>& points) {
  // In units of how far away the points are, more or less: powers of depths lose no digits then.
  double unit = 0;
  for (int i = 0; i < 3; ++i) {
    constexpr double kLeastChord = 1e-3;  // of directions
    const double chord = (rays[i].direction - rays[(i + 1) % 3].direction).norm();
    unit += (points[i] - points[(i + 1) % 3]).norm() / std::max(kLeastChord, chord) / 3;
  }
  if (!(unit > 0) || !std::isfinite(unit)) return {};
  std::array<RigRay, 3> scaled_rays = rays;
  std::array<Eigen::Vector3d, 3> scaled_points;
  for (int i = 0; i < 3; ++i) {
    scaled_rays[i].origin = (rays[i].origin - rays[0].origin) / unit;
    scaled_points[i] = (points[i] - points[0]) / unit;
  }
  const Eigen::Matrix3d world_axes = Axes(scaled_points);
  if (!world_axes.allFinite() || world_axes.col(2).isZero()) return {};
  MinimalPoses poses;
  for (const Eigen::Vector3d& depths : ThreeDepths(scaled_rays, scaled_points).Solve()) {
    std::array<Eigen::Vector3d, 3> in_rig;
    for (int i = 0; i < 3; ++i) in_rig[i] = scaled_rays[i].origin + depths[i] * scaled_rays[i].direction;
    const Eigen::Matrix3d rotation = Axes(in_rig) * world_axes.transpose();
    if (!rotation.allFinite()) continue;
    Pose pose;
    pose.rotation = Eigen::Quaterniond(rotation).normalized();
    pose.translation = rays[0].origin + unit * in_rig[0] - pose.rotation * points[0];
    poses.push_back(pose);
  }
  return poses;
}

MinimalPoses PosesFromTwoRays(const std::array<RigRay, 2>& rays, const std::array<Eigen::Vector3d, 2>& points,
                              const Eigen::Vector3d& up_in_rig, const Eigen::Vector3d& up_in_world) {
  // In level frames, z up, only the heading is open.
  const Eigen::Matrix3d level_from_rig = LevelFrom(up_in_rig), level_from_world = LevelFrom(up_in_world);
  std::array<Eigen::Vector3d, 2> d;
  for (int i = 0; i < 2; ++i) d[i] = level_from_rig * rays[i].direction;
  const Eigen::Vector3d origin = level_from_rig * (rays[0].origin - rays[1].origin);
  const Eigen::Vector3d apart = level_from_world * (points[0] - points[1]);
  // Heights: origin.z + x d0.z - y d1.z = apart.z gives one depth from the other, the better one.
  const bool solve_first = std::abs(d[0].z()) >= std::abs(d[1].z());
  const Eigen::Vector3d& solved = solve_first ? d[0] : d[1];
  const Eigen::Vector3d& free = solve_first ? d[1] : d[0];
  constexpr double kLevel = 1e-9;
  if (!(std::abs(solved.z()) > kLevel)) return {};
  const double sign = solve_first ? 1 : -1;  // of the solved one
  const double constant = sign * (apart.z() - origin.z()) / solved.z();
  const double slope = free.z() / solved.z();
  // Between the two points over the floor: a + depth b, as long as it is in the map.
  const Eigen::Vector2d a = origin.head<2>() + sign * constant * solved.head<2>();
  const Eigen::Vector2d b = sign * (slope * solved.head<2>() - free.head<2>());
  const double quadratic = b.squaredNorm(), half_linear = a.dot(b);
  const double discriminant =
      half_linear * half_linear - quadratic * (a.squaredNorm() - apart.head<2>().squaredNorm());
  if (!(quadratic > 0) || !(discriminant >= 0)) return {};
  MinimalPoses poses;
  for (const double root : {-std::sqrt(discriminant), std::sqrt(discriminant)}) {
    const double free_depth = (root - half_linear) / quadratic;
    const double solved_depth = constant + slope * free_depth;
    if (!(free_depth > 0) || !(solved_depth > 0)) continue;
    const Eigen::Vector2d in_rig = a + free_depth * b;
    const double heading = std::atan2(apart.y(), apart.x()) - std::atan2(in_rig.y(), in_rig.x());
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(-heading, Eigen::Vector3d::UnitZ()));
    Pose pose;
    pose.rotation =
        Eigen::Quaterniond(level_from_rig.transpose() * turn.toRotationMatrix() * level_from_world)
            .normalized();
    const double depth = solve_first ? solved_depth : free_depth;
    pose.translation = rays[0].origin + depth * rays[0].direction - pose.rotation * points[0];
    if (pose.translation.allFinite()) poses.push_back(pose);
  }
  return poses;
}

}  // namespace cairn
