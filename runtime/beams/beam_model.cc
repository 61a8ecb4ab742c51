#include "runtime/beams/beam_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>

#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "runtime/beams/pose_step.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// Standard deviations of ranges that are tried, metres: of an exact plan to one of a cluttered place.
constexpr std::array<double, 4> kSigmas = {0.02, 0.04, 0.08, 0.16};
// What the plan does not show stands so often in a beam's way, a metre.
constexpr double kUnexpected = 0.1;
// Share of beams that go through a wall, and that a wall throws back as expected.
constexpr double kThrough = 0.1, kThrownBack = 0.9;
// Beams that end anywhere, a metre; and that are lost.
constexpr double kAnywhere = 0.0005, kNothing = 0.05;
// A wall seen at a small angle: ranges scatter by no more than sigma / this.
constexpr double kLeastSine = 0.15;
constexpr double kLargestSigma = 0.5;  // metres
// Walls this far behind a beam's end do not matter, metres.
constexpr double kBehind = 1;

constexpr int kBeamSteps = 6;
constexpr double kLeastStep = 1e-5;                        // metres and radians
constexpr double kLongestStep = 0.2, kLargestTurn = 0.05;  // of one step
constexpr double kStayingPrior = 1e-4;

double Density(double off, double sigma) {
  return std::exp(-0.5 * off * off / (sigma * sigma)) / (sigma * std::sqrt(2 * std::numbers::pi));
}

// What no wall explains of a beam, if a share of beams comes so far through walls.
double Unexplained(const Beam& beam, double reaching) {
  const double unhindered = reaching * std::exp(-kUnexpected * beam.range_m);
  return beam.met ? kAnywhere + kUnexpected * unhindered : kNothing + unhindered;
}

}  // namespace

// A beam's end and the wall that it most likely met.
struct BeamModel::Match {
  int32_t wall = 0;
  double off = 0;       // beyond the wall, along its normal, metres
  double weight = 0;    // Tukey's
  Eigen::Vector3d row;  // of `off` by the pose
  double place = 0;     // along the wall, from where the robot is beside it, metres
};

double BeamModel::WeighWithoutWalls(const std::vector<Beam>& beams) const {
  double sum = 0;
  for (const Beam& beam : beams) sum += std::log(Unexplained(beam, 1));
  return sum;
}

BeamEvidence BeamModel::Weigh(const std::vector<Beam>& beams, const PlanarPose& pose) const {
  std::array<double, kSigmas.size()> sums{};
  std::array<int, kSigmas.size()> num_explained{};
  int num_met = 0;
  const Eigen::Rotation2Dd rotation(pose.heading_rad);
  for (const Beam& beam : beams) {
    const Vec2 direction = rotation * beam.direction;
    const double end = beam.range_m;
    const PlanRays::Hits hits = rays_.Cast(pose.position, direction, beam.met ? end + kBehind : end);
    double reaching = 1;  // share of beams that come so far through walls
    for (const PlanRays::Hit& hit : hits) {
      if (hit.distance_m < end) reaching *= kThrough;
    }
    const double unexplained = Unexplained(beam, reaching);
    std::array<double, kSigmas.size()> by_walls{};
    double share = kThrownBack;
    for (const PlanRays::Hit& hit : hits) {
      if (!beam.met) break;
      const PlanWall& wall = walls_[hit.wall];
      const Vec2 along = (wall.end - wall.start).normalized();
      const double sine = std::max(kLeastSine, std::abs(Cross(along, direction)));
      const double arrives = share * std::exp(-kUnexpected * hit.distance_m), off = end - hit.distance_m;
      for (size_t i = 0; i < kSigmas.size(); ++i)
        by_walls[i] += arrives * Density(off, std::min(kLargestSigma, kSigmas[i] / sine));
      share *= kThrough;
    }
    for (size_t i = 0; i < kSigmas.size(); ++i) {
      sums[i] += std::log(by_walls[i] + unexplained);
      num_explained[i] += by_walls[i] > unexplained ? 1 : 0;
    }
    num_met += beam.met ? 1 : 0;
  }
  const size_t best = std::max_element(sums.begin(), sums.end()) - sums.begin();
  return {sums[best], kSigmas[best], num_met == 0 ? 0 : static_cast<double>(num_explained[best]) / num_met};
}

void BeamModel::FindMatches(const std::vector<Beam>& beams, double sigma_m, const PlanarPose& pose,
                            std::vector<Match>* matches) const {
  matches->clear();
  const Eigen::Rotation2Dd rotation(pose.heading_rad);
  for (const Beam& beam : beams) {
    if (!beam.met) continue;
    const Vec2 direction = rotation * beam.direction, arm = beam.range_m * direction;
    Match best;
    double least = std::numeric_limits<double>::infinity(), behind = 0;
    for (const PlanRays::Hit& hit : rays_.Cast(pose.position, direction, beam.range_m + kBehind)) {
      const PlanWall& wall = walls_[hit.wall];
      const Vec2 along = (wall.end - wall.start).normalized(), normal(-along.y(), along.x());
      const double off = (beam.range_m - hit.distance_m) * normal.dot(direction);
      // Each wall in the way costs half a sigma.
      const double cost = std::abs(off) / sigma_m + behind;
      behind += 0.5;
      if (std::abs(off) >= 3 * sigma_m || cost >= least) continue;
      least = cost;
      best = {hit.wall, off, TukeyWeight(off, 3 * sigma_m), OffsetRow(normal, arm), along.dot(arm)};
    }
    if (std::isfinite(least)) matches->push_back(best);
  }
}

PlanarPose BeamModel::Refine(const std::vector<Beam>& beams, double sigma_m, const PlanarPose& pose) const {
  PlanarPose refined = pose;
  std::vector<Match> matches;
  for (int step = 0; step < kBeamSteps; ++step) {
    FindMatches(beams, sigma_m, refined, &matches);
    PoseStep change(kStayingPrior);
    for (const Match& match : matches) change.Add(match.weight, match.off, match.row);
    if (change.Move(kLongestStep, kLargestTurn, &refined) < kLeastStep) break;
  }
  return refined;
}

Eigen::Matrix3d BeamModel::Covariance(const std::vector<Beam>& beams, double sigma_m,
                                      const PlanarPose& pose) const {
  std::vector<Match> matches;
  FindMatches(beams, sigma_m, pose, &matches);
  std::stable_sort(matches.begin(), matches.end(),
                   [](const Match& a, const Match& b) { return a.wall < b.wall; });
  const double precision = 1 / (sigma_m * sigma_m);
  // Known to some ten metres, whatever the beams say: more would cost the other directions their digits.
  const Eigen::Matrix3d prior = Eigen::Vector3d(1e-2, 1e-2, 0.1).asDiagonal();
  Eigen::Matrix3d information = prior, scatter = prior;  // of the gradient that Refine brings to zero
  const Eigen::Matrix2d of_wall =
      Eigen::Vector2d(std::pow(options_.sigma_wall_m, 2), std::pow(RadFromDeg(options_.sigma_wall_deg), 2))
          .asDiagonal();
  for (auto begin = matches.begin(); begin != matches.end();) {
    const auto end =
        std::find_if(begin, matches.end(), [&](const Match& match) { return match.wall != begin->wall; });
    double weights = 0, middle = 0;  // of what is seen of the wall
    for (auto match = begin; match != end; ++match) {
      weights += match->weight;
      middle += match->weight * match->place;
    }
    middle /= weights;
    // The wall's offset there, and its turn, move all of its beams.
    Eigen::Matrix<double, 3, 2> by_wall = Eigen::Matrix<double, 3, 2>::Zero();
    for (auto match = begin; match != end; ++match) {
      const Eigen::Vector3d row = precision * match->weight * match->row;
      information += row * match->row.transpose();
      scatter += match->weight * row * match->row.transpose();
      by_wall += row * Eigen::RowVector2d(1, match->place - middle);
    }
    scatter += by_wall * of_wall * by_wall.transpose();
    begin = end;
  }
  const Eigen::Matrix3d inverse = information.inverse();
  const Eigen::Matrix3d covariance = inverse * scatter * inverse;
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace cairn
