#include "runtime/visual_map/visual_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/camera/camera_turn.h"
#include "core/geometry/pose.h"

namespace cairn {
namespace {

// Scales of keypoints lie within this many octaves: the density of a wrong match's scale.
constexpr double kScaleOctaves = 6;
constexpr int kNumTurnSteps = 3;

}  // namespace

Status CheckVisualInput(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                        const VisualEstimateOptions& options) {
  VisualEstimateOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  for (const SeenLandmark& match : seen) {
    if (match.landmark < 0 || match.landmark >= map.num_landmarks() || !match.seen.allFinite()) {
      return MakeError(ErrorCode::kInvalidArgument, "visual map: a match of landmark {} of {} is not valid",
                       match.landmark, map.num_landmarks());
    }
  }
  return Ok();
}

VisualSearch::VisualSearch(const VisualMap& map, const std::vector<SeenLandmark>& seen,
                           const VisualEstimateOptions& options, const std::vector<double>& log_prior)
    : map_(map), seen_(seen), options_(options), log_prior_(log_prior) {
  fit_.focal_px = map.focal_px();
  fit_.tilt_sigma_rad = std::hypot(RadFromDeg(options.tilt_sigma_deg), map.errors().tilt_rad);
  fit_.height_sigma_m = std::hypot(options.height_sigma_m, map.height_sigma_m());
  const double half_step_deg = 180.0 / static_cast<double>(map.headings_deg().size());
  fit_.max_left_rad = RadFromDeg(options.heading_margin_deg + (map.has_learnt_focal() ? half_step_deg : 0));
}

void VisualSearch::Run() {
  FindTerms();
  const auto num_headings = static_cast<int32_t>(map_.headings_deg().size());
  for (int32_t heading = 0; heading < num_headings; ++heading) {
    for (int32_t place = 0; place < static_cast<int32_t>(map_.places().size()); ++place) {
      VisualHypothesis hypothesis{.place = place, .heading = heading};
      Gather(hypothesis, map_.spacing_m() / std::sqrt(12.0));
      hypothesis.turn.left = VoteForLeft(items_, fit_);
      Fit(0, &hypothesis);
      hypotheses_.push_back(hypothesis);
    }
  }
  first_point_ = hypotheses_.size();
  Subdivide();
}

void VisualSearch::AddMissingMass(VisualHypothesis point, double reach_m) {
  const auto position = [&](const VisualHypothesis& of) {
    return Eigen::Vector2d(map_.places()[of.place] + of.offset);
  };
  // Of the point's mass.
  double share = 0;
  for (const VisualHypothesis& other : hypotheses_) {
    if (other.heading == point.heading && (position(other) - position(point)).norm() <= reach_m)
      share += std::exp(other.log_mass - point.log_mass);
  }
  // A maximum may end nearest to a place that the prior excludes.
  if (!(share < 1) || !std::isfinite(log_prior_[point.place])) return;
  point.log_mass += std::log1p(-share);
  hypotheses_.push_back(point);
}

void VisualSearch::FindTerms() {
  terms_.assign(map_.places().size() * map_.headings_deg().size(), {});
  for (int match = 0; match < static_cast<int>(seen_.size()); ++match) {
    for (const VisualMap::Model& model : map_.ModelsOf(seen_[match].landmark)) {
      for (const VisualMap::AtPlace& at : model.extent)
        terms_[static_cast<size_t>(model.heading) * map_.places().size() + at.place].push_back(
            {match, &model, &at});
    }
  }
}

const std::vector<VisualTerm>& VisualSearch::TermsOf(const VisualHypothesis& hypothesis) const {
  return terms_[static_cast<size_t>(hypothesis.heading) * map_.places().size() + hypothesis.place];
}

FitItem VisualSearch::MakeItem(const VisualTerm& term, const Eigen::Vector2d& offset, double spread_m) const {
  return MakeItem(term, term.at->seen + term.at->gradient * offset,
                  term.at->variance + spread_m * spread_m * term.at->gradient.rowwise().squaredNorm(),
                  term.at->rise);
}

FitItem VisualSearch::MakeItem(const VisualTerm& term, const LandmarkModel::Prediction& prediction,
                               const Eigen::Vector2d& position) const {
  return MakeItem(term, prediction.seen, map_.Variance(*term.model, position),
                  RiseOf(prediction.gradient, RadFromDeg(map_.headings_deg()[term.model->heading])));
}

FitItem VisualSearch::MakeItem(const VisualTerm& term, const Eigen::Vector3d& predicted,
                               const Eigen::Vector3d& variance, double rise) const {
  const double px = options_.visual_sigma_px, octaves = options_.visual_sigma_octaves;
  FitItem item;
  item.match = term.match;
  item.seen = seen_[term.match].seen;
  item.seen.head<2>() -= map_.middle_px();
  item.predicted = predicted;
  item.rise = rise;
  item.variance = variance + Eigen::Vector3d(px * px, px * px, octaves * octaves);
  item.log_odds = LogOdds(*term.model, item.variance);
  return item;
}

double VisualSearch::LogOdds(const VisualMap::Model& model, const Eigen::Vector3d& variance) const {
  const double outliers = model.predicts_badly ? 0.5 * (1 + options_.outlier_ratio) : options_.outlier_ratio;
  const double space = kScaleOctaves * map_.image_width_px() * map_.image_height_px();
  return std::log((1 - outliers) / outliers * space) - 1.5 * std::log(2 * std::numbers::pi) -
         0.5 * std::log(variance.prod());
}

void VisualSearch::Gather(const VisualHypothesis& hypothesis, double spread_m) {
  items_.clear();
  for (const VisualTerm& term : TermsOf(hypothesis))
    items_.push_back(MakeItem(term, hypothesis.offset, spread_m));
}

double VisualSearch::LogMassWithoutMatches(int32_t place) const {
  return log_prior_[place] + std::log(options_.outlier_ratio) * static_cast<double>(seen_.size());
}

void VisualSearch::Fit(double log_share, VisualHypothesis* hypothesis) const {
  // [Sala06 §VI-C] p(x | z) ~ p(z | x) p(x), as logarithms
  hypothesis->log_mass = LogMassWithoutMatches(hypothesis->place) + log_share +
                         FitTurn(items_, fit_, kNumTurnSteps, &hypothesis->turn);
}

// Replaces the best hypotheses by those of points around their places.
void VisualSearch::Subdivide() {
  std::vector<size_t> order(first_point_);
  std::iota(order.begin(), order.end(), size_t{0});
  const size_t count = std::min<size_t>(order.size(), options_.num_refined_places);
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
                    [&](size_t a, size_t b) {
                      return std::pair(-hypotheses_[a].log_mass, a) < std::pair(-hypotheses_[b].log_mass, b);
                    });
  const int n = options_.num_subdivisions;
  const double step_m = map_.spacing_m() / n;
  for (size_t i = 0; i < count; ++i) {
    for (int row = 0; row < n; ++row) {
      for (int col = 0; col < n; ++col) {
        VisualHypothesis point = hypotheses_[order[i]];
        point.offset = {(col - 0.5 * (n - 1)) * step_m, (row - 0.5 * (n - 1)) * step_m};
        Gather(point, step_m / std::sqrt(12.0));
        Fit(-2 * std::log(n), &point);
        hypotheses_.push_back(point);
      }
    }
    hypotheses_[order[i]].log_mass = -std::numeric_limits<double>::infinity();
  }
}

}  // namespace cairn
