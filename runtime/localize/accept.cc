#include "runtime/localize/accept.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

#include "core/base/pooled.h"
#include "core/work/work_budget.h"
#include "runtime/localize/place_evidence.h"

namespace cairn {
namespace {

// Of probabilities short of 1 by rounding, too.
double OddsOf(double probability) { return probability / std::max(1e-12, 1 - probability); }

// Where an image may have been taken.
struct Explanation {
  Pose cam_from_world;
  int num_matches = 0;  // that agree on it, found without it
  double odds = 0;
  const Localization* fix = nullptr;  // null: one of several
};

PooledVector<Explanation> ExplanationsOf(const Localization& found) {
  if (found.has_fix())
    return {{found.cam_from_world, found.num_unguided_inliers, OddsOf(found.probability), &found}};
  PooledVector<Explanation> several;
  for (size_t k = 0; k < found.possible_poses.size(); ++k) {
    // P = odds / (1 + the odds of all).
    const double odds = found.possible_probabilities[k] / std::max(1e-12, 1 - found.probability);
    several.push_back({found.possible_poses[k], found.num_unguided_inliers, odds, nullptr});
  }
  return several;
}

// The places that explain an image, each by what it has most matches for, that with most first; without those
// that a fix is a thousand times likelier than.
PooledVector<Explanation> PlacesOf(const std::vector<Localization>& found, const AcceptOptions& accept) {
  PooledVector<Explanation> places;
  for (const Localization& each : found) {
    for (const Explanation& explanation : ExplanationsOf(each)) places.push_back(explanation);
  }
  std::stable_sort(places.begin(), places.end(),
                   [](const auto& a, const auto& b) { return a.num_matches > b.num_matches; });
  // Of a place the one with most matches.
  for (size_t i = 0; i < places.size(); ++i) {
    const auto is_here = [&](const Explanation& other) {
      return !AreFarApart(places[i].cam_from_world, other.cam_from_world, accept);
    };
    const auto others = places.begin() + static_cast<std::ptrdiff_t>(i) + 1;
    if (places[i].fix == nullptr) {  // a fix knows its place better
      const auto fix = std::find_if(others, places.end(), [&](const Explanation& other) {
        return other.fix != nullptr && is_here(other);
      });
      if (fix != places.end()) {
        places[i].fix = fix->fix;
        places[i].odds = fix->odds;
      }
    }
    places.erase(std::remove_if(others, places.end(), is_here), places.end());
  }
  const Explanation likeliest = *std::max_element(
      places.begin(), places.end(), [](const auto& a, const auto& b) { return a.odds < b.odds; });
  constexpr double kHopeless = 1e-3;
  if (likeliest.fix != nullptr)
    std::erase_if(places, [&](const Explanation& place) { return place.odds < kHopeless * likeliest.odds; });
  return places;
}

int NumCells(const Sighting& sighting, std::span<const Correspondence> inliers, int grid) {
  const auto side = static_cast<size_t>(grid) + 1;  // the last of pixels on the image's edge
  PooledVector<char> cells(sighting.images.size() * side * side);
  const auto cell = [&](float coordinate, int size) {
    return static_cast<size_t>(std::clamp(static_cast<int>(coordinate * grid / size), 0, grid));
  };
  for (const Correspondence& inlier : inliers) {
    const Query& query = sighting.images[inlier.image];
    const Keypoint& keypoint = query.features.keypoints[inlier.keypoint];
    const size_t row = inlier.image * side + cell(keypoint.y, query.camera.height);
    cells[row * side + cell(keypoint.x, query.camera.width)] = 1;
  }
  return static_cast<int>(std::ranges::count(cells, 1));
}

double Log10Choose(int n, int k) {
  return (std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0)) / std::numbers::ln10;
}

}  // namespace

double ChanceOfInlier(std::span<const PoseMeasurement> measurements, const Pose& rig_from_world,
                      double max_error_px, const Sighting& sighting) {
  constexpr size_t kMaxSamples = 400;  // matches looked at; pairs grow with their square
  const size_t stride = measurements.size() / kMaxSamples + 1;
  struct Seen {
    const PoseMeasurement* measurement;
    Eigen::Vector2d ray;  // of the landmark
  };
  PooledVector<Seen> samples;
  for (size_t i = 0; i < measurements.size(); i += stride) {
    const Eigen::Vector3d point = measurements[i].InCamera(rig_from_world * measurements[i].point);
    if (point.z() > 0) samples.push_back({&measurements[i], point.hnormalized()});
  }
  if (!Spend(sighting.work, Work::kMatchPair, samples.size() * samples.size())) return 1;
  int64_t num_close = 0, num_pairs = 0;
  for (const Seen& keypoint : samples) {
    for (const Seen& landmark : samples) {
      if (&keypoint == &landmark || keypoint.measurement->image != landmark.measurement->image) continue;
      const QueryRay& ray = keypoint.measurement->ray;
      num_close +=
          (ray.pixel_from_ray * (landmark.ray - ray.ray)).squaredNorm() <= max_error_px * max_error_px ? 1
                                                                                                       : 0;
      ++num_pairs;
    }
  }
  double area_px = 0;
  for (const Query& query : sighting.images)
    area_px += static_cast<double>(query.camera.width) * query.camera.height;
  const double disc = std::numbers::pi * max_error_px * max_error_px / area_px * sighting.num_images();
  return std::min(1.0, std::max(disc, static_cast<double>(num_close) /
                                          static_cast<double>(std::max<int64_t>(1, num_pairs))));
}

double Log10ChancePoses(int num_matches, int num_inliers, double chance_of_inlier, int sample_size) {
  if (num_inliers <= sample_size) return std::numeric_limits<double>::infinity();
  return Log10Choose(num_matches, sample_size) +
         Log10Choose(num_matches - sample_size, num_inliers - sample_size) +
         (num_inliers - sample_size) * std::log10(chance_of_inlier);
}

const char* NoFixName(NoFix reason) {
  switch (reason) {
    case NoFix::kNone:
      return "none";
    case NoFix::kTooFewFeatures:
      return "too_few_features";
    case NoFix::kNoCandidates:
      return "no_candidates";
    case NoFix::kTooFewMatches:
      return "too_few_matches";
    case NoFix::kNoPose:
      return "no_pose";
    case NoFix::kTooFewInliers:
      return "too_few_inliers";
    case NoFix::kPoorSpread:
      return "poor_spread";
    case NoFix::kUncertain:
      return "uncertain";
    case NoFix::kFarFromSurvey:
      return "far_from_survey";
    case NoFix::kAmbiguous:
      return "ambiguous";
    case NoFix::kImprobable:
      return "improbable";
    case NoFix::kTilted:
      return "tilted";
    case NoFix::kOverBudget:
      return "over_budget";
  }
  return "none";
}

OptionTable DescribeOptions(AcceptOptions* o) {
  OptionTable table = {
      {.name = "min_num_features",
       .value = &o->min_num_features,
       .help = "fewest features of the image",
       .min = 4},
      {.name = "min_num_matches",
       .value = &o->min_num_matches,
       .help = "fewest matches for which a pose is tried",
       .min = 4},
      {.name = "min_num_unguided_inliers",
       .value = &o->min_num_unguided_inliers,
       .help = "fewest matches, found without the pose, that agree with it",
       .min = 4},
      {.name = "max_log10_chance",
       .value = &o->max_log10_chance,
       .help = "largest log10 of the number of poses that random matches would agree on equally well"},
      {.name = "min_num_inliers", .value = &o->min_num_inliers, .help = "fewest inliers in all", .min = 5},
      {.name = "min_kept_ratio",
       .value = &o->min_kept_ratio,
       .help = "smallest number of inliers after refinement, as part of those before",
       .min = 0,
       .max = 1},
      {.name = "min_guided_sigmas",
       .value = &o->min_guided_sigmas,
       .help =
           "fewest landmarks found where the pose says above those found beside these places, in standard "
           "deviations of the latter; 0: not tested",
       .min = 0},
      {.name = "min_probability",
       .value = &o->min_probability,
       .help = "smallest probability that the pose is right, by what an image from there should show and "
               "does not; "
               "0: not tested",
       .min = 0,
       .max = 1},
      {.name = "spread_grid",
       .value = &o->spread_grid,
       .help = "cells per side of the image for the spread",
       .min = 1,
       .max = 1000},
      {.name = "min_num_cells", .value = &o->min_num_cells, .help = "fewest cells with inliers", .min = 1},
      {.name = "max_sigma_m",
       .value = &o->max_sigma_m,
       .help = "largest standard deviation of the place in the worst direction, m",
       .min = 1e-6},
      {.name = "max_sigma_deg",
       .value = &o->max_sigma_deg,
       .help = "largest standard deviation of the rotation about the worst axis, degrees",
       .min = 1e-6},
      {.name = "max_up_sigmas",
       .value = &o->max_up_sigmas,
       .help = "where up is sensed: largest angle between it and the fix's up, standard deviations",
       .min = 0.1},
      {.name = "max_distance_from_survey_m",
       .value = &o->max_distance_from_survey_m,
       .help = "largest distance from the nearest survey image, m; 0: any",
       .min = 0},
      {.name = "max_second_pose_ratio",
       .value = &o->max_second_pose_ratio,
       .help = "a second pose elsewhere with half this part of the first one's inliers, and with this part "
               "after guided matching, makes it ambiguous; 0: not looked for",
       .min = 0,
       .max = 1},
      {.name = "num_second_pose_iterations",
       .value = &o->num_second_pose_iterations,
       .help = "samples that look for the second pose",
       .min = 1},
      {.name = "second_pose_distance_m",
       .value = &o->second_pose_distance_m,
       .help = "poses this far apart are different, m",
       .min = 1e-6},
      {.name = "second_pose_angle_deg",
       .value = &o->second_pose_angle_deg,
       .help = "poses this far apart are different, degrees",
       .min = 1e-6},
  };
  AddCondition({"max_second_pose_ratio", {"not 0"}},
               {"num_second_pose_iterations", "second_pose_distance_m", "second_pose_angle_deg"}, &table);
  return table;
}

Verdict JudgeGuided(int num_found, double num_by_chance, const AcceptOptions& options) {
  if (options.min_guided_sigmas > 0 &&
      num_found < num_by_chance + options.min_guided_sigmas * std::sqrt(num_by_chance)) {
    return {NoFix::kTooFewInliers,
            fmt::format("{} landmarks are where the pose says, and beside it there are {:.0f}: no more than "
                        "by chance",
                        num_found, num_by_chance)};
  }
  return {};
}

Verdict JudgePose(const RefinedPose& pose, std::span<const Correspondence> inliers, const Sighting& sighting,
                  double distance_from_survey_m, const AcceptOptions& options, const char* length_unit) {
  if (static_cast<int>(inliers.size()) < options.min_num_inliers) {
    return {NoFix::kTooFewInliers,
            fmt::format("{} inliers, at least {} are needed", inliers.size(), options.min_num_inliers)};
  }
  const int num_cells = NumCells(sighting, inliers, options.spread_grid);
  if (num_cells < options.min_num_cells) {
    return {NoFix::kPoorSpread, fmt::format("inliers in {} cells of the image, at least {} are needed",
                                            num_cells, options.min_num_cells)};
  }
  const double sigma_deg = DegFromRad(LargestSigma(pose.covariance.topLeftCorner<3, 3>()));
  const double sigma_m = LargestSigma(pose.covariance.bottomRightCorner<3, 3>());
  if (!(sigma_m <= options.max_sigma_m) || !(sigma_deg <= options.max_sigma_deg)) {
    return {NoFix::kUncertain,
            fmt::format("standard deviation {:.3f} {} and {:.2f} degrees, at most {} and {} are allowed",
                        sigma_m, length_unit, sigma_deg, options.max_sigma_m, options.max_sigma_deg)};
  }
  const double up_sigmas = sighting.up ? UpErrorInSigmas(*sighting.up, pose.cam_from_world) : 0;
  if (up_sigmas > options.max_up_sigmas) {
    const double sigma_up_deg = DegFromRad(sighting.up->sigma_rad);
    return {
        NoFix::kTilted,
        fmt::format("up is {:.1f} degrees off the sensed one, at most {:.1f} are allowed; if fixes without "
                    "gravity are right, the map's up is not, or the sensor's axes are not the camera's",
                    up_sigmas * sigma_up_deg, options.max_up_sigmas * sigma_up_deg)};
  }
  if (options.max_distance_from_survey_m > 0 && distance_from_survey_m > options.max_distance_from_survey_m) {
    return {NoFix::kFarFromSurvey,
            fmt::format("{:.1f} {} from the nearest survey image, at most {} are allowed",
                        distance_from_survey_m, length_unit, options.max_distance_from_survey_m)};
  }
  return {};
}

bool AreFarApart(const Pose& a, const Pose& b, const AcceptOptions& accept) {
  return CenterErrorM(a, b) > accept.second_pose_distance_m ||
         RotationErrorDeg(a, b) > accept.second_pose_angle_deg;
}

Localization Ambiguous(Localization localization, std::vector<Pose> poses, std::vector<double> odds,
                       double odds_of_others, std::string message) {
  localization.reason = NoFix::kAmbiguous;
  localization.message = std::move(message);
  localization.possible_poses = std::move(poses);
  double sum = 0;
  for (const double each : odds) sum += each;
  localization.probability = ProbabilityAmong(sum, odds_of_others);
  localization.possible_probabilities.clear();
  for (const double each : odds)
    localization.possible_probabilities.push_back(ProbabilityAmong(each, sum - each + odds_of_others));
  return localization;
}

Localization DecideAmong(const std::vector<Localization>& found, double least_odds,
                         const AcceptOptions& accept) {
  const PooledVector<Explanation> places = PlacesOf(found, accept);
  const Explanation& best = places.front();
  double odds_of_all = 0;
  for (const Explanation& place : places) odds_of_all += place.odds;
  Localization decided = best.fix != nullptr ? *best.fix : found.front();
  const double probability = ProbabilityAmong(best.odds, odds_of_all - best.odds);
  std::vector<Pose> poses;
  std::vector<double> odds;
  std::string numbers;
  for (const Explanation& place : places) {
    // How many landmarks a place has says how often it was surveyed; the odds know what was to be expected.
    const bool is_alike = place.num_matches >= accept.max_second_pose_ratio * best.num_matches ||
                          place.odds * least_odds > best.odds;
    if (&place != &best && !is_alike) continue;
    poses.push_back(place.cam_from_world);
    odds.push_back(place.odds);
    numbers += fmt::format("{}{}", numbers.empty() ? "" : " and ", place.num_matches);
  }
  if (best.fix != nullptr && (poses.size() == 1 || accept.max_second_pose_ratio <= 0)) {
    decided.probability = probability;
    return decided;
  }
  double odds_of_others = odds_of_all;
  for (const double each : odds) odds_of_others -= each;
  return Ambiguous(std::move(decided), std::move(poses), std::move(odds), std::max(0.0, odds_of_others),
                   numbers + " matches agree on poses at different places");
}

Localization BetterOf(Localization first, Localization second, const AcceptOptions& accept) {
  if (!first.has_places() && !second.has_places()) {
    const bool is_better =
        std::pair(second.num_inliers, second.num_matches) >= std::pair(first.num_inliers, first.num_matches);
    return is_better ? second : first;
  }
  if (!first.has_places()) return second;
  if (!second.has_places()) return first;
  if (!first.has_fix() && second.has_fix() && second.scope == Scope::kAll) return second;
  return DecideAmong({std::move(first), std::move(second)}, 1, accept);
}

}  // namespace cairn
