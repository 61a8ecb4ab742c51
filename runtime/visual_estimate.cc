#include "runtime/visual_estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/camera_turn.h"
#include "core/document_scores.h"
#include "core/pose.h"
#include "runtime/no_throw.h"
#include "runtime/visual_search.h"

namespace cairn {
namespace {

constexpr int kNumPoseSteps = 10;
// Best poses between places that are refined.
constexpr int kNumRefined = 3;
// Points per three standard deviations around the maximum that share out its probability.
constexpr int kSpreadSteps = 7;
// How much of the uniform distribution a posterior with a flag gets.
constexpr double kFlaggedUniform = 0.5;

using Matrix5d = Eigen::Matrix<double, 5, 5>;
using Vector5d = Eigen::Matrix<double, 5, 1>;

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
    Normalise(&pose);
    const auto refined = BestRefined();
    if (!refined) {
      return Flagged(std::move(pose), VisualFlag::kDisagree, "no place explains two matches");
    }
    SpreadAround(*refined, &pose);
    FillPose(*refined, &pose);
    return Judge(*refined, std::move(pose));
  }

 private:
  struct Refined {
    VisualHypothesis start;
    Eigen::Vector2d position;
    Turn turn;
    double log_ratio = 0;
    Eigen::Matrix3d covariance;  // x, y, heading
    std::vector<int> agreeing;   // matches
  };

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

  std::optional<Refined> BestRefined() const {
    const std::vector<VisualHypothesis>& hypotheses = search_.hypotheses();
    std::vector<size_t> order(hypotheses.size() - search_.first_point());
    std::iota(order.begin(), order.end(), search_.first_point());
    std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return std::pair(-hypotheses[a].log_mass, a) < std::pair(-hypotheses[b].log_mass, b);
    });
    std::optional<Refined> best;
    std::vector<std::pair<int32_t, int32_t>> tried;
    for (const size_t i : order) {
      const std::pair place(hypotheses[i].place, hypotheses[i].heading);
      if (std::find(tried.begin(), tried.end(), place) != tried.end()) continue;
      if (static_cast<int>(tried.size()) == kNumRefined) break;
      tried.push_back(place);
      const auto refined = Refine(hypotheses[i]);
      if (refined && (!best || refined->log_ratio > best->log_ratio)) best = refined;
    }
    return best;
  }

  // Gauss-Newton over place and turn with the models themselves.
  std::optional<Refined> Refine(const VisualHypothesis& start) const {
    const std::vector<VisualTerm>& terms = search_.TermsOf(start);
    const double tilt_weight = 1 / (search_.fit().tilt_sigma_rad * search_.fit().tilt_sigma_rad);
    Refined refined{
        .start = start, .position = map_.places()[start.place] + start.offset, .turn = start.turn};
    for (int step = 0;; ++step) {
      const bool is_last = step == kNumPoseSteps;
      const Turn& turn = refined.turn;
      const Eigen::Matrix3d rotation = CameraTurn(turn.left, turn.up, turn.clockwise);
      Matrix5d normal = Vector5d(1e-4, 1e-4, 1, tilt_weight, tilt_weight).asDiagonal();
      Vector5d gradient(0, 0, 0, tilt_weight * turn.up, tilt_weight * turn.clockwise);
      refined.log_ratio = -0.5 * tilt_weight * (turn.up * turn.up + turn.clockwise * turn.clockwise);
      refined.agreeing.clear();
      for (const VisualTerm& term : terms) {
        const LandmarkModel::Prediction prediction = term.model->interpolation.Predict(refined.position);
        const FitItem item =
            search_.MakeItem(term, prediction.seen, map_.Variance(*term.model, refined.position));
        Eigen::Vector3d error;
        Eigen::Matrix3d by_turn;
        if (!ItemError(item, rotation, search_.fit().focal_px, &error, &by_turn)) continue;
        const ItemScore score = ScoreItem(item, error);
        refined.log_ratio += score.log_ratio;
        if (score.weight > 0.5) refined.agreeing.push_back(term.match);
        Eigen::Matrix<double, 3, 5> jacobian;
        jacobian << TurnGradient(item.predicted, rotation, search_.fit().focal_px) * prediction.gradient,
            by_turn;
        const Eigen::Vector3d weight = score.weight * item.variance.cwiseInverse();
        normal += jacobian.transpose() * weight.asDiagonal() * jacobian;
        gradient += jacobian.transpose() * weight.asDiagonal() * error;
      }
      const Matrix5d inverse = normal.inverse();
      if (!inverse.allFinite()) return std::nullopt;
      if (is_last) {
        const double shared_m = std::hypot(options_.shared_sigma_m, map_.errors().shared_m);
        const double shared_rad = std::hypot(RadFromDeg(options_.shared_sigma_deg), map_.errors().shared_rad);
        refined.covariance = inverse.topLeftCorner<3, 3>();
        refined.covariance.diagonal() +=
            Eigen::Vector3d(shared_m * shared_m, shared_m * shared_m, shared_rad * shared_rad);
        return refined;
      }
      Vector5d change = -(inverse * gradient);
      const double way_m = change.head<2>().norm();
      if (way_m > map_.spacing_m()) change *= map_.spacing_m() / way_m;
      refined.position += change.head<2>();
      refined.turn.left += change[2];
      refined.turn.up = std::clamp(refined.turn.up + change[3], -0.5, 0.5);
      refined.turn.clockwise = std::clamp(refined.turn.clockwise + change[4], -0.5, 0.5);
    }
  }

  int32_t NearestPlace(const Eigen::Vector2d& at) const {
    int32_t nearest = 0;
    for (int32_t place = 1; place < num_places_; ++place) {
      if ((map_.places()[place] - at).squaredNorm() < (map_.places()[nearest] - at).squaredNorm())
        nearest = place;
    }
    return nearest;
  }

  // What the points around the maximum have of the posterior is shared out anew among the places, as the
  // normal distribution of the refined pose says: the points are too far apart to do so.
  void SpreadAround(const Refined& refined, VisualPose* pose) const {
    const int32_t heading = refined.start.heading;
    double mass = 0;
    for (int32_t place = 0; place < num_places_; ++place) {
      if ((map_.places()[place] - refined.position).norm() > 1.5 * map_.spacing_m()) continue;
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

  void FillPose(const Refined& refined, VisualPose* pose) const {
    pose->position = refined.position;
    const double heading_deg = map_.headings_deg()[refined.start.heading] + DegFromRad(refined.turn.left);
    pose->heading_deg = heading_deg - 360 * std::floor(heading_deg / 360);
    std::vector<int> agreeing = refined.agreeing;
    std::sort(agreeing.begin(), agreeing.end());
    pose->num_agreeing = static_cast<int>(std::unique(agreeing.begin(), agreeing.end()) - agreeing.begin());
    // What lies farther off than the refinement goes widens the covariance.
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

  // Of a camera that may be anywhere in the survey.
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

  VisualPose Judge(const Refined& refined, VisualPose pose) const {
    // Matches that could agree with it.
    const VisualHypothesis found{.place = NearestPlace(pose.position), .heading = refined.start.heading};
    const auto num_possible =
        static_cast<double>(std::max(search_.TermsOf(found).size(), search_.TermsOf(refined.start).size()));
    if (pose.num_agreeing < options_.min_num_agreeing || pose.elsewhere > 0.5 ||
        pose.num_agreeing < options_.min_agreeing_ratio * num_possible) {
      return Flagged(std::move(pose), VisualFlag::kDisagree,
                     fmt::format("{} of {} matches that could agree with the best pose do, at least {} and "
                                 "{:.0f} % are needed; elsewhere with a probability of {:.2g}",
                                 pose.num_agreeing, num_possible, options_.min_num_agreeing,
                                 100 * options_.min_agreeing_ratio, pose.elsewhere));
    }
    const double spread_px = SpreadOf(refined.agreeing);
    const double needed_px =
        options_.min_spread_ratio * std::hypot(map_.image_width_px(), map_.image_height_px());
    if (spread_px < needed_px) {
      return Flagged(std::move(pose), VisualFlag::kOneSpot,
                     fmt::format("the landmarks lie {:.0f} px apart, at least {:.0f} px are needed",
                                 spread_px, needed_px));
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

  // Root mean square distance from the middle of these matches in the query.
  double SpreadOf(const std::vector<int>& matches) const {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const int match : matches) mean += seen_[match].seen.head<2>() / static_cast<double>(matches.size());
    double sum = 0;
    for (const int match : matches) sum += (seen_[match].seen.head<2>() - mean).squaredNorm();
    return std::sqrt(sum / static_cast<double>(std::max<size_t>(matches.size(), 1)));
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

Status CheckInput(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                  const VisualEstimateOptions& options, const std::vector<double>& prior) {
  VisualEstimateOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  for (const SeenLandmark& match : seen) {
    if (match.landmark < 0 || match.landmark >= map.num_landmarks() || !match.seen.allFinite()) {
      return MakeError(ErrorCode::kInvalidArgument, "visual map: a match of landmark {} of {} makes no sense",
                       match.landmark, map.num_landmarks());
    }
  }
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

Result<VisualPose> EstimateVisualPose(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                                      const VisualEstimateOptions& options,
                                      const std::vector<double>& prior) {
  return WithoutExceptions("visual map", [&]() -> Result<VisualPose> {
    CAIRN_RETURN_IF_ERROR(CheckInput(map, seen, options, prior));
    return Estimator(map, seen, options, prior).Run();
  });
}

double PosteriorDivergence(const VisualPose& p, const VisualPose& q, double uniform_weight) {
  const auto count = static_cast<double>(p.at_place.size() + 1);
  const auto mixed = [&](double share) { return (1 - uniform_weight) * share + uniform_weight / count; };
  const auto part = [&](double of_p, double of_q) {
    return mixed(of_p) > 0 ? mixed(of_p) * std::log(mixed(of_p) / mixed(of_q)) : 0.0;
  };
  double divergence = part(p.elsewhere, q.elsewhere);
  for (size_t i = 0; i < p.at_place.size(); ++i) divergence += part(p.at_place[i], q.at_place[i]);
  return divergence;
}

}  // namespace cairn
