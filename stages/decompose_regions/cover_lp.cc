#include "stages/decompose_regions/cover_lp.h"

#include <algorithm>
#include <utility>

namespace cairn {
namespace {

// Share of the step that goes to the dual side; dual values are small beside primal ones.
constexpr double kDualWeight = 0.15;

}  // namespace

CoverLp::CoverLp(const RegionPool& pool, std::vector<char> open, int max_uncovered)
    : pool_(&pool),
      open_(std::move(open)),
      max_uncovered_(max_uncovered),
      s_(open_.size(), 0),
      y_(open_.size(), 0),
      mean_y_(open_.size(), 0),
      covered_(open_.size(), 0) {
  num_open_ = static_cast<int>(std::count(open_.begin(), open_.end(), 1));
}

void CoverLp::StartFrom(const CoverLp& other) {
  for (size_t v = 0; v < open_.size(); ++v) y_[v] = open_[v] ? other.y_[v] : 0;
  z_ = other.z_;
}

void CoverLp::Fix(int region) {
  for (const StationIdx station : (*pool_)[region].stations) {
    if (!open_[station]) continue;
    open_[station] = 0;
    --num_open_;
    y_[station] = 0;
    is_collected_ = false;
  }
}

void CoverLp::CollectOpen() {
  if (is_collected_ && static_cast<int>(x_.size()) == pool_->size()) return;
  is_collected_ = true;
  x_.resize(pool_->size(), 0);
  collected_ = {};
  std::vector<int> num_regions(open_.size(), 0);
  for (int region = 0; region < pool_->size(); ++region) {
    const size_t begin = collected_.stations.size();
    for (const StationIdx station : (*pool_)[region].stations) {
      if (!open_[station]) continue;
      collected_.stations.push_back(station);
      ++num_regions[station];
    }
    if (collected_.stations.size() == begin) {
      x_[region] = 0;
      continue;
    }
    collected_.regions.push_back(region);
    collected_.begins.push_back(begin);
  }
  collected_.begins.push_back(collected_.stations.size());
  for (size_t v = 0; v < open_.size(); ++v) {
    if (!open_[v]) continue;
    collected_.open_stations.push_back(static_cast<StationIdx>(v));
    collected_.dual_steps.push_back(kDualWeight / (1.0 + num_regions[v]));
  }
}

// Primal step of x against the reduced costs 1 - y(R); `covered_` sums the extrapolated point 2x' - x.
void CoverLp::StepRegions(double weight) {
  for (const StationIdx station : collected_.open_stations) covered_[station] = 0;
  for (size_t i = 0; i < collected_.regions.size(); ++i) {
    const size_t begin = collected_.begins[i], end = collected_.begins[i + 1];
    double value = 0;
    for (size_t j = begin; j < end; ++j) value += y_[collected_.stations[j]];
    double& x = x_[collected_.regions[i]];
    const double next = std::max(0.0, x - (1.0 - value) / (kDualWeight * static_cast<double>(end - begin)));
    const double extrapolated = 2.0 * next - x;
    x = next;
    mean_x_[collected_.regions[i]] += weight * next;
    if (extrapolated == 0) continue;
    for (size_t j = begin; j < end; ++j) covered_[collected_.stations[j]] += extrapolated;
  }
}

// Primal step of s against z - y_v, then the dual steps of y and z.
void CoverLp::StepStations(double weight) {
  double num_uncovered = 0;
  for (size_t i = 0; i < collected_.open_stations.size(); ++i) {
    const StationIdx v = collected_.open_stations[i];
    const double next = std::clamp(s_[v] - (z_ - y_[v]) / (2.0 * kDualWeight), 0.0, 1.0);
    const double extrapolated = 2.0 * next - s_[v];
    s_[v] = next;
    num_uncovered += extrapolated;
    y_[v] = std::max(0.0, y_[v] + collected_.dual_steps[i] * (1.0 - covered_[v] - extrapolated));
    mean_y_[v] += weight * y_[v];
  }
  z_ = std::max(0.0, z_ + kDualWeight / num_open_ * (num_uncovered - max_uncovered_));
}

void CoverLp::Iterate(int num_iterations) {
  CollectOpen();
  mean_x_.assign(pool_->size(), 0);
  mean_y_.assign(open_.size(), 0);
  if (num_open_ == 0) return;
  for (int iteration = 0; iteration < num_iterations; ++iteration) {
    StepRegions(1.0 / num_iterations);
    StepStations(1.0 / num_iterations);
  }
}

}  // namespace cairn
