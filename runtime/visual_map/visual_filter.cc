#include "runtime/visual_map/visual_filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/geometry/floor_pose.h"
#include "core/geometry/pose.h"
#include "core/vocabulary/document_scores.h"

namespace cairn {
namespace {

constexpr int kNumBins = 72;
constexpr double kBinRad = 2 * std::numbers::pi / kNumBins;
// A place or heading is known to within its cell, so a step adds a cell's variance (a twelfth of its side's
// square) where it does not end in the middle of another cell.
constexpr double kCellVariance = 1.0 / 12;
// Cells farther off than this many standard deviations get nothing.
constexpr double kReachSigmas = 3;
// A turn less certain than this may have ended in any direction: more bins would only take time.
constexpr double kUnknownTurnRad = 2 * std::numbers::pi;
// Beliefs below this part of the largest do not move.
constexpr double kLeastShare = 1e-9;

void Normalise(std::vector<std::vector<double>>* belief) {
  double sum = 0;
  for (const std::vector<double>& of_place : *belief)
    sum = std::accumulate(of_place.begin(), of_place.end(), sum);
  for (std::vector<double>& of_place : *belief) {
    for (double& share : of_place)
      share = sum > 0 ? share / sum : 1.0 / static_cast<double>(belief->size() * kNumBins);
  }
}

int BinOf(double heading_rad) {
  const auto bin = static_cast<int>(std::lround(heading_rad / kBinRad)) % kNumBins;
  return bin < 0 ? bin + kNumBins : bin;
}

// How likely a turn ends in the bins around it: weights of bins first, first + 1, ... that sum to 1.
struct TurnKernel {
  int first = 0;
  std::vector<double> weights;
};

TurnKernel KernelOf(double turn_rad, double sigma_rad) {
  const double bounded_rad = std::min(sigma_rad, kUnknownTurnRad);
  const double variance = bounded_rad * bounded_rad + kCellVariance * kBinRad * kBinRad;
  const auto reach = static_cast<int>(std::ceil(kReachSigmas * std::sqrt(variance) / kBinRad));
  TurnKernel kernel{.first = static_cast<int>(std::lround(turn_rad / kBinRad)) - reach};
  double sum = 0;
  for (int i = 0; i <= 2 * reach; ++i) {
    const double away = (kernel.first + i) * kBinRad - turn_rad;
    kernel.weights.push_back(std::exp(-0.5 * away * away / variance));
    sum += kernel.weights.back();
  }
  for (double& weight : kernel.weights) weight /= sum;
  return kernel;
}

}  // namespace

OptionTable DescribeOptions(VisualFilterOptions* o) {
  return {
      {"odometry_way_ratio", &o->odometry_way_ratio, "odometry's standard deviation, as part of the way", 0},
      {"odometry_turn_ratio", &o->odometry_turn_ratio, "odometry's standard deviation, as part of the turn",
       0},
      {"odometry_sigma_m", &o->odometry_sigma_m,
       "odometry's standard deviation at every step in addition, metres", 0},
      {"odometry_sigma_deg", &o->odometry_sigma_deg,
       "odometry's standard deviation at every step in addition, degrees", 0},
      {"kidnapped_ratio", &o->kidnapped_ratio,
       "probability that the robot was carried away since the last image", 0, 1}};
}

VisualFilter::VisualFilter(std::shared_ptr<const VisualMap> map, const VisualFilterOptions& options,
                           const VisualEstimateOptions& estimate_options)
    : map_(std::move(map)), options_(options), estimate_options_(estimate_options) {
  belief_.assign(map_->places().size(), std::vector<double>(kNumBins, 1));
  Normalise(&belief_);
}

std::vector<double> VisualFilter::AtPlaces() const {
  std::vector<double> at_places;
  for (const std::vector<double>& of_place : belief_)
    at_places.push_back(std::accumulate(of_place.begin(), of_place.end(), 0.0));
  return at_places;
}

Status VisualFilter::Move(const Eigen::Vector2d& way_m, double turn_left_rad) {
  if (!std::isfinite(way_m.squaredNorm()) || !std::isfinite(turn_left_rad))
    return MakeError(ErrorCode::kInvalidArgument,
                     "visual map: the odometry's way or turn is not a finite number, or too large");
  const double cell_variance = kCellVariance * map_->spacing_m() * map_->spacing_m();
  Shift(way_m,
        std::pow(options_.odometry_way_ratio * way_m.norm(), 2) + std::pow(options_.odometry_sigma_m, 2) +
            (way_m.norm() > 0 ? cell_variance : 0),
        turn_left_rad,
        std::hypot(options_.odometry_turn_ratio * turn_left_rad, RadFromDeg(options_.odometry_sigma_deg)));
  return Ok();
}

Status VisualFilter::Wander(double sigma_m, double sigma_rad) {
  if (!(sigma_m >= 0 && sigma_rad >= 0 && std::isfinite(sigma_m + sigma_rad)))
    return MakeError(
        ErrorCode::kInvalidArgument,
        "visual map: a way of {:g} m and a turn of {:g} rad as standard deviations; both must be "
        "finite and not negative",
        sigma_m, sigma_rad);
  Shift({0, 0}, sigma_m * sigma_m, 0, sigma_rad);
  return Ok();
}

double VisualFilter::AtHeading(int32_t place, double heading_deg, double half_sector_deg) const {
  double sum = 0;
  for (int bin = 0; bin < kNumBins; ++bin) {
    if (AngleBetweenDeg(DegFromRad(bin * kBinRad), heading_deg) <= half_sector_deg)
      sum += belief_[place][bin];
  }
  return sum;
}

void VisualFilter::Shift(const Eigen::Vector2d& way_m, double way_variance, double turn_left_rad,
                         double turn_sigma_rad) {
  const std::vector<Eigen::Vector2d>& places = map_->places();
  const TurnKernel turn = KernelOf(std::remainder(turn_left_rad, 2 * std::numbers::pi), turn_sigma_rad);
  double largest = 0;
  for (const std::vector<double>& of_place : belief_)
    for (const double share : of_place) largest = std::max(largest, share);
  std::vector<std::vector<double>> moved(places.size(), std::vector<double>(kNumBins, 0));
  const double reach_m = kReachSigmas * std::sqrt(way_variance) + 1e-9;
  for (int bin = 0; bin < kNumBins; ++bin) {
    const double c = std::cos(bin * kBinRad), s = std::sin(bin * kBinRad);
    const Eigen::Vector2d way(c * way_m.x() - s * way_m.y(), s * way_m.x() + c * way_m.y());
    for (size_t from = 0; from < places.size(); ++from) {
      const double share = belief_[from][bin];
      if (!(share > kLeastShare * largest)) continue;
      std::vector<std::pair<size_t, double>> reached;
      double sum = 0;
      for (size_t to = 0; to < places.size(); ++to) {
        const double squared = (places[to] - places[from] - way).squaredNorm();
        if (squared > reach_m * reach_m) continue;
        reached.emplace_back(to, way_variance > 0 ? std::exp(-0.5 * squared / way_variance) : 1);
        sum += reached.back().second;
      }
      for (const auto& [to, weight] : reached) {  // probability that leaves the survey is lost
        for (size_t i = 0; i < turn.weights.size(); ++i) {
          const int to_bin = ((bin + turn.first + static_cast<int>(i)) % kNumBins + kNumBins) % kNumBins;
          // [Sala06 §VI-C] the Markov chain's step: the belief moves as the odometry says, and widens
          moved[to][to_bin] += share * weight / sum * turn.weights[i];
        }
      }
    }
  }
  belief_ = std::move(moved);
  Normalise(&belief_);
}

Result<VisualPose> VisualFilter::See(const std::vector<SeenLandmark>& seen) {
  const auto num_places = static_cast<double>(belief_.size());
  for (std::vector<double>& of_place : belief_) {
    for (double& share : of_place) {
      share = (1 - options_.kidnapped_ratio) * share + options_.kidnapped_ratio / (num_places * kNumBins);
    }
  }
  Normalise(&belief_);
  const std::vector<double> prior = AtPlaces();
  CAIRN_ASSIGN_OR_RETURN(VisualPose pose, EstimateVisualPose(*map_, seen, estimate_options_, prior));
  // [Sala06 §VI-C] p(z | x) per place and heading; "elsewhere" carries no information about either.
  for (size_t place = 0; place < belief_.size(); ++place) {
    std::vector<double> likelihood(kNumBins, pose.elsewhere);
    for (size_t heading = 0; heading < map_->headings_deg().size() && prior[place] > 0; ++heading) {
      const double mass = pose.at_heading[place][heading] / prior[place];
      const double at = RadFromDeg(map_->headings_deg()[heading]) + pose.turn_rad[place][heading];
      const int bin = BinOf(at);
      for (const auto& [step, part] : {std::pair(-1, 0.25), std::pair(0, 0.5), std::pair(1, 0.25)})
        likelihood[(bin + step + kNumBins) % kNumBins] += mass * part * kNumBins;
    }
    for (int bin = 0; bin < kNumBins; ++bin) belief_[place][bin] *= likelihood[bin];
  }
  Normalise(&belief_);
  pose.at_place = AtPlaces();
  pose.elsewhere = 0;
  Eigen::Matrix2d spread =
      Eigen::Matrix2d::Identity() * kCellVariance * map_->spacing_m() * map_->spacing_m();
  pose.mean.setZero();
  pose.entropy = Entropy(pose.at_place);
  for (size_t place = 0; place < belief_.size(); ++place) {
    pose.mean += pose.at_place[place] * map_->places()[place];
  }
  for (size_t place = 0; place < belief_.size(); ++place) {
    const Eigen::Vector2d away = map_->places()[place] - pose.mean;
    spread += pose.at_place[place] * away * away.transpose();
  }
  if (pose.flag != VisualFlag::kNone) {
    pose.position = pose.mean;
    pose.covariance.topLeftCorner<2, 2>() = spread;
    AddScaleError(*map_, &pose);
  }
  return pose;
}

}  // namespace cairn
