#include "runtime/visual_map/visual_estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/base/no_throw.h"
#include "core/geometry/pose.h"
#include "core/vocabulary/document_scores.h"
#include "runtime/visual_map/lattice_posterior.h"
#include "runtime/visual_map/visual_refine.h"
#include "runtime/visual_map/visual_search.h"

namespace cairn {
namespace {

// Maxima that are refined, and how far around one its points lie; on the lattice wider ones are left as they
// are.
constexpr int kNumRefined = 3;
constexpr double kReachSpacings = 1.5;
// Points per three standard deviations around the maximum that share out its probability.
constexpr int kSpreadSteps = 7;
// A survey localizes its own images badly when their landmarks' shared errors are larger than this part of
// its spacing.
constexpr double kUnsureSpacings = 0.25;
// How much of the uniform distribution a posterior with a flag gets.
constexpr double kFlaggedUniform = 0.5;
// The prior of "elsewhere" where it is no possibility; it is divided out.
constexpr double kNoElsewhere = 1e-9;

class Estimator {
 public:
  Estimator(const VisualMap& map, const std::vector<SeenLandmark>& seen, const VisualEstimateOptions& options,
            const std::vector<double>& prior)
      : map_(map),
        seen_(seen),
        options_(options),
        num_places_(static_cast<int32_t>(map.places().size())),
        search_(map, seen, options, log_prior_) {
    for (int32_t place = 0; place < num_places_; ++place) {
      // [Sala06 §VI-C] p(x) is uniform over the places, here beside "elsewhere"
      const double share = prior.empty() ? 1.0 / num_places_ : prior[place];
      log_prior_.push_back(std::log((1 - options.elsewhere_ratio) * share));
    }
  }

  VisualPose Run() {
    VisualPose pose;
    pose.num_matches = NumLandmarks();
    if (pose.num_matches < 2) {
      SpreadEvenly(&pose);
      return Flagged(std::move(pose), VisualFlag::kTooFewMatches,
                     fmt::format("{} matched landmarks, at least 2 are needed", pose.num_matches));
    }
    search_.Run();
    const auto refined = Best(RefineMaxima());
    Normalise(&pose);
    if (!refined) {
      return Flagged(std::move(pose), VisualFlag::kDisagree, "no place explains two matches");
    }
    SpreadAround(*refined, &pose);
    FillPose(*refined, &pose);
    return Judge(*refined, std::move(pose));
  }

  // [Sala06 §VI-C] p(x | z) over the places alone, and no pose
  LatticePosterior RunOnLattice() {
    VisualPose pose;
    search_.Run();
    const int num_landmarks = NumLandmarks();
    std::vector<DensityMaximum> maxima;
    if (num_landmarks >= 2) maxima = RefineMaxima(kReachSpacings * map_.spacing_m());
    const auto refined = Best(maxima);
    Normalise(&pose);
    if (refined && WidthM(*refined) < kReachSpacings * map_.spacing_m()) SpreadAround(*refined, &pose);
    const double sum = std::accumulate(pose.at_place.begin(), pose.at_place.end(), 0.0);
    for (double& share : pose.at_place) share /= sum;
    return {.at_place = std::move(pose.at_place), .num_matches = num_landmarks};
  }

 private:
  int NumLandmarks() const {
    std::vector<LandmarkIdx> landmarks;
    for (const SeenLandmark& match : seen_) landmarks.push_back(match.landmark);
    std::sort(landmarks.begin(), landmarks.end());
    return static_cast<int>(std::unique(landmarks.begin(), landmarks.end()) - landmarks.begin());
  }

  void Normalise(VisualPose* pose) {
    const double log_elsewhere = std::log(options_.elsewhere_ratio);
    double largest = log_elsewhere;
    for (const VisualHypothesis& hypothesis : search_.hypotheses())
      largest = std::max(largest, hypothesis.log_mass);
    double sum = std::exp(log_elsewhere - largest);
    for (const VisualHypothesis& hypothesis : search_.hypotheses())
      sum += std::exp(hypothesis.log_mass - largest);
    log_sum_ = largest + std::log(sum);
    pose->elsewhere = std::exp(log_elsewhere - log_sum_);
    const size_t num_headings = map_.headings_deg().size();
    pose->at_heading.assign(num_places_, std::vector<double>(num_headings, 0));
    pose->turn_rad.assign(num_places_, std::vector<double>(num_headings, 0));
    std::vector<std::vector<double>> best(num_places_, std::vector<double>(num_headings, -1));
    for (const VisualHypothesis& hypothesis : search_.hypotheses()) {
      const double share = ShareOf(hypothesis);
      pose->at_heading[hypothesis.place][hypothesis.heading] += share;
      if (share <= best[hypothesis.place][hypothesis.heading]) continue;
      best[hypothesis.place][hypothesis.heading] = share;
      pose->turn_rad[hypothesis.place][hypothesis.heading] = hypothesis.turn.left;
    }
    for (const std::vector<double>& of_place : pose->at_heading)
      pose->at_place.push_back(std::accumulate(of_place.begin(), of_place.end(), 0.0));
  }

  double ShareOf(const VisualHypothesis& hypothesis) const {
    return std::exp(hypothesis.log_mass - log_sum_);
  }

  // The most likely maxima, each refined from the best point around it; their masses are those of the search,
  // or Laplace's approximation of the maximum itself where that is larger: points lie too far apart for
  // sharp maxima.  Those wider than `max_width_m` are left to the search: its points resolve them, and
  // Laplace's approximation of a maximum that the matches hardly determine reaches beyond the survey.
  std::vector<DensityMaximum> RefineMaxima(double max_width_m = std::numeric_limits<double>::infinity()) {
    const std::vector<VisualHypothesis>& hypotheses = search_.hypotheses();
    std::vector<size_t> order(hypotheses.size() - search_.first_point());
    std::iota(order.begin(), order.end(), search_.first_point());
    std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return std::pair(-hypotheses[a].log_mass, a) < std::pair(-hypotheses[b].log_mass, b);
    });
    std::vector<DensityMaximum> maxima;
    std::vector<std::pair<int32_t, int32_t>> tried;
    for (const size_t i : order) {
      const std::pair place(hypotheses[i].place, hypotheses[i].heading);
      const Eigen::Vector2d at = map_.places()[place.first] + hypotheses[i].offset;
      if (std::find(tried.begin(), tried.end(), place) != tried.end()) continue;
      if (std::any_of(maxima.begin(), maxima.end(), [&](const DensityMaximum& other) {
            return other.start.heading == place.second && IsAround(other, at);
          }))
        continue;
      if (static_cast<int>(tried.size()) == kNumRefined) break;
      tried.push_back(place);
      if (auto refined = RefineFromNearest(hypotheses[i])) maxima.push_back(std::move(*refined));
    }
    for (const DensityMaximum& refined : maxima) {
      if (WidthM(refined) < max_width_m)
        search_.AddMissingMass(PointAt(refined), kReachSpacings * map_.spacing_m());
    }
    return maxima;
  }
  // Standard deviation of the place, in any direction.
  static double WidthM(const DensityMaximum& maximum) {
    return std::sqrt(maximum.covariance.topLeftCorner<2, 2>().trace());
  }

  VisualHypothesis PointAt(const DensityMaximum& refined) const {
    const int32_t place = NearestPlace(refined.position);
    return {.place = place,
            .heading = refined.start.heading,
            .offset = refined.position - map_.places()[place],
            .turn = refined.turn,
            .log_mass = refined.log_mass};
  }

  // Uses the models that extend to where it ends: repeats where that is nearer to another place.
  std::optional<DensityMaximum> RefineFromNearest(const VisualHypothesis& start) const {
    auto refined = RefinePose(map_, search_, start);
    if (!refined) return refined;
    const VisualHypothesis end = PointAt(*refined);
    if (end.place == start.place) return refined;
    auto again = RefinePose(map_, search_, end);
    return again && again->log_density > refined->log_density ? again : refined;
  }

  bool IsAround(const DensityMaximum& refined, const Eigen::Vector2d& at) const {
    return (at - refined.position).norm() <= kReachSpacings * map_.spacing_m();
  }

  // The best maximum, with the shared part of landmarks' errors.
  std::optional<DensityMaximum> Best(std::vector<DensityMaximum> maxima) const {
    // [Sala06 §VI-C] The estimate is the maximum of p(x | z): here refined between the places.
    const auto best = std::max_element(
        maxima.begin(), maxima.end(),
        [](const DensityMaximum& a, const DensityMaximum& b) { return a.log_density < b.log_density; });
    if (best == maxima.end()) return std::nullopt;
    const double growth = SharedGrowth(SpreadRatio(best->agreeing));
    const double shared_m = std::hypot(options_.shared_sigma_m, growth * map_.errors().shared_m);
    const double shared_rad =
        std::hypot(RadFromDeg(options_.shared_sigma_deg), growth * map_.errors().shared_rad);
    best->covariance.diagonal() +=
        Eigen::Vector3d(shared_m * shared_m, shared_m * shared_m, shared_rad * shared_rad);
    return *best;
  }

  int32_t NearestPlace(const Eigen::Vector2d& at) const {
    int32_t nearest = 0;
    for (int32_t place = 1; place < num_places_; ++place) {
      if ((map_.places()[place] - at).squaredNorm() < (map_.places()[nearest] - at).squaredNorm())
        nearest = place;
    }
    return nearest;
  }

  // Distributes the posterior of the points around the maximum again among the places, by the normal
  // distribution of the refined pose: the points themselves are too far apart.
  void SpreadAround(const DensityMaximum& refined, VisualPose* pose) const {
    const int32_t heading = refined.start.heading;
    double mass = 0;
    for (int32_t place = 0; place < num_places_; ++place) {
      if (!IsAround(refined, map_.places()[place])) continue;
      mass += pose->at_heading[place][heading];
      pose->at_place[place] -= pose->at_heading[place][heading];
      pose->at_heading[place][heading] = 0;
    }
    const Eigen::Matrix2d covariance = refined.covariance.topLeftCorner<2, 2>();
    const Eigen::LLT<Eigen::Matrix2d> factor(covariance);
    std::vector<std::pair<int32_t, double>> shares;
    double sum = 0;
    for (int row = -kSpreadSteps; row <= kSpreadSteps; ++row) {
      for (int column = -kSpreadSteps; column <= kSpreadSteps; ++column) {
        const Eigen::Vector2d sigmas = 3.0 / kSpreadSteps * Eigen::Vector2d(column, row);
        const Eigen::Vector2d at = refined.position + factor.matrixL() * sigmas;
        const int32_t place = NearestPlace(at);
        const double share = std::exp(-0.5 * sigmas.squaredNorm()) * std::exp(log_prior_[place]);
        shares.emplace_back(place, share);
        sum += share;
      }
    }
    for (const auto& [place, share] : shares) {
      const double part = sum > 0 ? mass * share / sum : mass / static_cast<double>(shares.size());
      pose->at_heading[place][heading] += part;
      pose->at_place[place] += part;
      pose->turn_rad[place][heading] = refined.turn.left;
    }
    for (double& share : pose->at_place) share = std::max(share, 0.0);
  }

  void FillPose(const DensityMaximum& refined, VisualPose* pose) const {
    pose->position = refined.position;
    pose->higher_m = refined.turn.higher_m;
    pose->spread_ratio = SpreadRatio(refined.agreeing);
    const double heading_deg = map_.headings_deg()[refined.start.heading] + DegFromRad(refined.turn.left);
    pose->heading_deg = heading_deg - 360 * std::floor(heading_deg / 360);
    std::vector<int> agreeing = refined.agreeing;
    std::sort(agreeing.begin(), agreeing.end());
    pose->num_agreeing = static_cast<int>(std::unique(agreeing.begin(), agreeing.end()) - agreeing.begin());
    // The posterior outside the range of the refinement widens the covariance.
    pose->covariance = refined.covariance;
    pose->mean.setZero();
    double sum = 0;
    for (const VisualHypothesis& hypothesis : search_.hypotheses()) {
      const double share = ShareOf(hypothesis);
      const Eigen::Vector2d at = map_.places()[hypothesis.place] + hypothesis.offset;
      pose->mean += share * at;
      sum += share;
      const Eigen::Vector2d away = at - pose->position;
      if (away.norm() < map_.spacing_m()) continue;
      pose->covariance.topLeftCorner<2, 2>() += share * away * away.transpose();
      const double turn = std::remainder(RadFromDeg(map_.headings_deg()[hypothesis.heading]) +
                                             hypothesis.turn.left - RadFromDeg(pose->heading_deg),
                                         2 * std::numbers::pi);
      pose->covariance(2, 2) += share * turn * turn;
    }
    pose->mean = sum > 0 ? Eigen::Vector2d(pose->mean / sum) : pose->position;
    pose->covariance += pose->elsewhere * SurveyCovariance();
    pose->entropy = EntropyOf(*pose);
  }

  static double EntropyOf(const VisualPose& pose) {
    std::vector<double> shares = pose.at_place;
    shares.push_back(pose.elsewhere);
    return Entropy(shares);
  }

  // The covariance of a camera that may be anywhere in the survey.
  Eigen::Matrix3d SurveyCovariance() const {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& place : map_.places()) mean += place / num_places_;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector2d& place : map_.places())
      covariance.topLeftCorner<2, 2>() += (place - mean) * (place - mean).transpose() / num_places_;
    covariance(0, 0) += map_.spacing_m() * map_.spacing_m();
    covariance(1, 1) += map_.spacing_m() * map_.spacing_m();
    covariance(2, 2) = std::numbers::pi * std::numbers::pi / 3;
    return covariance;
  }

  void SpreadEvenly(VisualPose* pose) const {
    const size_t num_headings = map_.headings_deg().size();
    pose->elsewhere = options_.elsewhere_ratio;
    for (int32_t place = 0; place < num_places_; ++place) {
      pose->at_place.push_back(std::exp(log_prior_[place]));
      pose->at_heading.emplace_back(num_headings, pose->at_place.back() / static_cast<double>(num_headings));
      pose->turn_rad.emplace_back(num_headings, 0.0);
      pose->mean += map_.places()[place] * pose->at_place.back() / (1 - options_.elsewhere_ratio);
    }
    pose->position = pose->mean;
  }

  VisualPose Judge(const DensityMaximum& refined, VisualPose pose) const {
    // Matches that could agree with it.
    const VisualHypothesis found{.place = NearestPlace(pose.position), .heading = refined.start.heading};
    pose.num_possible =
        static_cast<int>(std::max(search_.TermsOf(found).size(), search_.TermsOf(refined.start).size()));
    const int num_needed = map_.errors().shared_m > kUnsureSpacings * map_.spacing_m()
                               ? std::max(options_.min_num_agreeing, options_.min_num_agreeing_unsure)
                               : options_.min_num_agreeing;
    if (pose.num_agreeing < num_needed || pose.elsewhere > 0.5 ||
        pose.num_agreeing < options_.min_agreeing_ratio * pose.num_possible) {
      return Flagged(std::move(pose), VisualFlag::kDisagree,
                     fmt::format("{} of {} matches that could agree with the best pose do, at least {} and "
                                 "{:.0f} % are needed; elsewhere with a probability of {:.2g}",
                                 pose.num_agreeing, pose.num_possible, num_needed,
                                 100 * options_.min_agreeing_ratio, pose.elsewhere));
    }
    if (pose.spread_ratio < options_.min_spread_ratio) {
      const double diagonal_px = DiagonalPx();
      return Flagged(std::move(pose), VisualFlag::kOneSpot,
                     fmt::format("the landmarks lie {:.0f} px apart, at least {:.0f} px are needed",
                                 pose.spread_ratio * diagonal_px, options_.min_spread_ratio * diagonal_px));
    }
    const double nearest_m = (map_.places()[found.place] - pose.position).norm();
    const double farthest_m = options_.max_distance_spacings * map_.spacing_m();
    if (nearest_m > farthest_m) {
      return Flagged(std::move(pose), VisualFlag::kOutside,
                     fmt::format("the best pose lies {:.2f} m from the survey, at most {:.2f} m are allowed",
                                 nearest_m, farthest_m));
    }
    return pose;
  }

  double DiagonalPx() const { return std::hypot(map_.image_width_px(), map_.image_height_px()); }

  // Root mean square distance from the middle of these matches in the query, as part of the diagonal.
  double SpreadRatio(const std::vector<int>& matches) const {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const int match : matches) mean += seen_[match].seen.head<2>() / static_cast<double>(matches.size());
    double sum = 0;
    for (const int match : matches) sum += (seen_[match].seen.head<2>() - mean).squaredNorm();
    return std::sqrt(sum / static_cast<double>(std::max<size_t>(matches.size(), 1))) / DiagonalPx();
  }

  VisualPose Flagged(VisualPose pose, VisualFlag flag, std::string message) const {
    pose.flag = flag;
    pose.message = std::move(message);
    for (double& share : pose.at_place)
      share = (1 - kFlaggedUniform) * share + kFlaggedUniform / (num_places_ + 1);
    for (std::vector<double>& of_place : pose.at_heading) {
      for (double& share : of_place) {
        share = (1 - kFlaggedUniform) * share +
                kFlaggedUniform / ((num_places_ + 1) * static_cast<double>(of_place.size()));
      }
    }
    pose.elsewhere = (1 - kFlaggedUniform) * pose.elsewhere + kFlaggedUniform / (num_places_ + 1);
    pose.covariance = SurveyCovariance();
    pose.entropy = EntropyOf(pose);
    return pose;
  }

  const VisualMap& map_;
  const std::vector<SeenLandmark>& seen_;
  const VisualEstimateOptions& options_;
  int32_t num_places_;
  std::vector<double> log_prior_;
  VisualSearch search_;
  double log_sum_ = 0;
};

std::vector<LandmarkIdx> LandmarksSeen(const std::vector<SeenLandmark>& seen) {
  std::vector<LandmarkIdx> landmarks;
  for (const SeenLandmark& match : seen) landmarks.push_back(match.landmark);
  return landmarks;
}

Status CheckPrior(const VisualMap& map, const std::vector<double>& prior) {
  if (prior.empty()) return Ok();
  double sum = 0;
  bool is_valid = prior.size() == map.places().size();
  for (const double share : prior) {
    is_valid = is_valid && share >= 0;
    sum += share;
  }
  if (!is_valid || !(std::abs(sum - 1) < 1e-6)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "visual map: a prior of {} places with the sum {:g}; expected {} probabilities that sum "
                     "to 1",
                     prior.size(), sum, map.places().size());
  }
  return Ok();
}

}  // namespace

double SharedGrowth(double spread_ratio) {
  const double ratio = kFullSpreadRatio / std::max(spread_ratio, 1e-3);
  return std::max(1.0, ratio * ratio);
}

Result<VisualPose> EstimateVisualPose(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                                      const VisualEstimateOptions& options,
                                      const std::vector<double>& prior) {
  return WithoutExceptions("visual map", [&]() -> Result<VisualPose> {
    CAIRN_RETURN_IF_ERROR(CheckVisualInput(map, seen, options));
    CAIRN_RETURN_IF_ERROR(CheckPrior(map, prior));
    CAIRN_ASSIGN_OR_RETURN(const auto loaded, map.With(LandmarksSeen(seen)));
    VisualPose pose = Estimator(*loaded, seen, options, prior).Run();
    AddScaleError(map, &pose);
    return pose;
  });
}

void AddScaleError(const VisualMap& map, VisualPose* pose) {
  pose->scale_sigma_m = map.ScaleSigmaAt(pose->position);
  pose->covariance.topLeftCorner<2, 2>() += pose->scale_sigma_m * pose->scale_sigma_m.transpose();
}

Result<LatticePosterior> PosteriorOnLattice(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                                            const VisualEstimateOptions& options) {
  return WithoutExceptions("visual map", [&]() -> Result<LatticePosterior> {
    CAIRN_RETURN_IF_ERROR(CheckVisualInput(map, seen, options));
    VisualEstimateOptions without_elsewhere = options;
    without_elsewhere.elsewhere_ratio = kNoElsewhere;
    CAIRN_ASSIGN_OR_RETURN(const auto loaded, map.With(LandmarksSeen(seen)));
    return Estimator(*loaded, seen, without_elsewhere, {}).RunOnLattice();
  });
}

double PosteriorDivergence(const VisualPose& p, const VisualPose& q, double uniform_weight) {
  const auto with_elsewhere = [](const VisualPose& pose) {
    std::vector<double> shares = pose.at_place;
    shares.push_back(pose.elsewhere);
    return shares;
  };
  return KlDivergence(with_elsewhere(p), with_elsewhere(q), uniform_weight);
}

}  // namespace cairn
