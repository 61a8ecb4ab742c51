#include "runtime/belief/pose_belief.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/geometry/pose.h"

namespace cairn {
namespace {

// Poses nearer to each other than so many standard deviations squared, by the better one's covariance and a
// little, are one.
constexpr double kOnePlaceSquared = 4;
// A place that is seen within so many standard deviations squared of an expected one is that one.
constexpr double kNearSquared = 16;
// A share of places errs by so much more than it says, squared: wheels slip.
constexpr double kSlips = 0.05, kSlipSquared = 9;
// What agrees less than this with a place is left out: anything that is seen weighs about 1, or far more.
constexpr double kLeastTogether = 1e-12;
constexpr double kOnePlaceM = 0.1, kOnePlaceRad = 3 * std::numbers::pi / 180;

Eigen::Vector3d Difference(const PlanarPose& a, const PlanarPose& b) {
  Eigen::Vector3d difference;
  difference << a.position - b.position, WrapAngle(a.heading_rad - b.heading_rad);
  return difference;
}

PlanarPose Moved(const PlanarPose& pose, const Eigen::Vector3d& by) {
  return {pose.position + by.head<2>(), WrapAngle(pose.heading_rad + by[2])};
}

// Two statements of one pose as one, and the density of their difference, 1 / (m^2 rad).
struct Agreement {
  double density = 0;
  UncertainPlanarPose both;
};

Agreement Agree(const UncertainPlanarPose& a, const UncertainPlanarPose& b) {
  const Eigen::Matrix3d sum = a.covariance + b.covariance;
  const Eigen::LDLT<Eigen::Matrix3d> solver(sum);
  const Eigen::Vector3d apart = Difference(b.pose, a.pose), scaled = solver.solve(apart);
  const double squared = apart.dot(scaled);
  Agreement agreement;
  agreement.density =
      std::exp(-0.5 * squared) / std::sqrt(std::pow(2 * std::numbers::pi, 3) * sum.determinant());
  const Eigen::Matrix3d gain = a.covariance * solver.solve(Eigen::Matrix3d::Identity());
  agreement.both.pose = Moved(a.pose, gain * apart);
  agreement.both.covariance = a.covariance - gain * a.covariance;
  agreement.both.covariance =
      (0.5 * (agreement.both.covariance + agreement.both.covariance.transpose())).eval();
  return agreement;
}

// Whether two statements differ by no more than so many standard deviations squared.
bool IsWithin(const UncertainPlanarPose& a, const UncertainPlanarPose& b, double squared) {
  const Eigen::Vector3d apart = Difference(a.pose, b.pose);
  return apart.dot((a.covariance + b.covariance).ldlt().solve(apart)) < squared;
}

bool AreOnePlace(const UncertainPlanarPose& better, const UncertainPlanarPose& other) {
  const Eigen::Vector3d apart = Difference(other.pose, better.pose);
  const Eigen::Matrix3d least =
      Eigen::Vector3d(kOnePlaceM * kOnePlaceM, kOnePlaceM * kOnePlaceM, kOnePlaceRad * kOnePlaceRad)
          .asDiagonal();
  const Eigen::Matrix3d covariance = better.covariance + least / kOnePlaceSquared;
  return apart.dot(covariance.ldlt().solve(apart)) < kOnePlaceSquared;
}

// A place, where the likeliest of what is seen near to it says that it is; known as well as by that alone, as
// looks from one place err together.
UncertainPlanarPose Corrected(const UncertainPlanarPose& place, std::span<const PossiblePlace> seen) {
  double most = 0;
  UncertainPlanarPose corrected = place;
  for (const PossiblePlace& near : seen) {
    if (!IsWithin(near, place, kNearSquared)) continue;
    const Agreement agreement = Agree(place, near);
    if (!(near.probability * agreement.density > most)) continue;
    most = near.probability * agreement.density;
    corrected = {agreement.both.pose,
                 near.covariance.trace() < place.covariance.trace() ? near.covariance : place.covariance};
  }
  return corrected;
}

}  // namespace

UncertainPlanarPose operator*(const UncertainPlanarPose& body, const PlanarPose& b_from_c) {
  UncertainPlanarPose carried;
  carried.pose = body.pose * b_from_c;
  const Eigen::Vector2d arm = carried.pose.position - body.pose.position;
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Identity();
  jacobian.topRightCorner<2, 1>() = Eigen::Vector2d(-arm.y(), arm.x());
  carried.covariance = jacobian * body.covariance * jacobian.transpose();
  return carried;
}

OptionTable DescribeOptions(PoseBeliefOptions* o) {
  return {
      {.name = "surprise_ratio",
       .value = &o->surprise_ratio,
       .help = "share of scans and of images that are of another place, whatever they say",
       .min = 1e-9,
       .max = 0.5},
      {.name = "lost_ratio",
       .value = &o->lost_ratio,
       .help = "chance from one to the next that the robot was carried elsewhere",
       .min = 1e-9,
       .max = 0.5},
      {.name = "least_probability",
       .value = &o->least_probability,
       .help = "places less probable than this are given up",
       .min = 1e-12,
       .max = 0.5},
      {.name = "max_num_places",
       .value = &o->max_num_places,
       .help = "places that are kept at most",
       .min = 1},
  };
}

void PoseBelief::Move(const UncertainPlanarPose& next_from_last) {
  for (PossiblePlace& place : places_) {
    const Eigen::Rotation2Dd rotation(place.pose.heading_rad);
    const Eigen::Vector2d way = rotation * next_from_last.pose.position;
    Eigen::Matrix3d by_pose = Eigen::Matrix3d::Identity(), by_step = Eigen::Matrix3d::Identity();
    by_pose.topRightCorner<2, 1>() = Eigen::Vector2d(-way.y(), way.x());
    by_step.topLeftCorner<2, 2>() = rotation.toRotationMatrix();
    place.covariance = by_pose * place.covariance * by_pose.transpose() +
                       by_step * next_from_last.covariance * by_step.transpose();
    place.pose = {place.pose.position + way,
                  WrapAngle(place.pose.heading_rad + next_from_last.pose.heading_rad)};
  }
}

void PoseBelief::Update(std::span<const PossiblePlace> told) {
  std::vector<PossiblePlace> seen;
  double sum_seen = 0;
  for (const PossiblePlace& place : told) {
    if (!place.pose.position.allFinite() || !std::isfinite(place.pose.heading_rad) ||
        !place.covariance.allFinite() || !(place.probability > 0 && std::isfinite(place.probability)))
      continue;
    seen.push_back(place);
    sum_seen += place.probability;
  }
  for (PossiblePlace& place : seen) place.probability /= std::max(1.0, sum_seen);
  for (PossiblePlace& place : places_) place.probability *= 1 - options_.lost_ratio;
  elsewhere_ += options_.lost_ratio * (1 - elsewhere_);
  const double trust = 1 - options_.surprise_ratio;
  double known = 0;
  for (const PossiblePlace& place : seen) known += trust * place.probability;
  std::vector<PossiblePlace> updated;
  // Of a look by itself, had the robot been anywhere.
  const double anywhere = area_m2_ * 2 * std::numbers::pi;
  for (const PossiblePlace& place : seen) {
    const auto add = [&](const UncertainPlanarPose& before, double probability) {
      const Agreement agreement = Agree(before, place);
      const double together = trust * place.probability * probability * agreement.density * anywhere;
      if (together > kLeastTogether) updated.push_back({agreement.both, together});
    };
    for (const PossiblePlace& before : places_) {
      add(before, (1 - kSlips) * before.probability);
      add({before.pose, kSlipSquared * before.covariance}, kSlips * before.probability);
    }
    PossiblePlace alone = place;
    alone.probability *= trust * elsewhere_;
    updated.push_back(alone);
  }
  for (PossiblePlace& place : places_) {
    // A look that speaks against a place may still tell where in it the robot is, but not how exactly.
    place.pose = Corrected(place, seen).pose;
    place.probability *= 1 - known;
  }
  elsewhere_ *= 1 - known;
  places_.insert(places_.end(), updated.begin(), updated.end());
  Tidy();
}

void PoseBelief::Correct(std::span<const PossiblePlace> seen) {
  for (PossiblePlace& place : places_) static_cast<UncertainPlanarPose&>(place) = Corrected(place, seen);
}

void PoseBelief::Tidy() {
  std::stable_sort(places_.begin(), places_.end(), [](const PossiblePlace& a, const PossiblePlace& b) {
    return a.probability > b.probability;
  });
  std::vector<PossiblePlace> kept;
  double sum = elsewhere_;
  for (const PossiblePlace& place : places_) sum += place.probability;
  for (const PossiblePlace& place : places_) {
    if (place.probability < options_.least_probability * sum) break;
    const auto same = std::find_if(kept.begin(), kept.end(),
                                   [&](const PossiblePlace& better) { return AreOnePlace(better, place); });
    if (same != kept.end()) {
      same->probability += place.probability;
    } else if (std::ssize(kept) < options_.max_num_places) {
      kept.push_back(place);
    }
  }
  places_ = std::move(kept);
  double total = 0;
  for (const PossiblePlace& place : places_) total += place.probability;
  total += elsewhere_;
  for (PossiblePlace& place : places_) place.probability /= total;
  elsewhere_ /= total;
}

}  // namespace cairn
