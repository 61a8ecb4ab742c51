#include "stages/decompose_regions/cover/cover_lp.h"

#include <algorithm>
#include <utility>

namespace cairn::decompose_regions {
namespace {

// Share of the step that goes to the dual side; dual values are small compared with primal ones.
constexpr double kDualWeight = 0.15;

}  // namespace

CoverLp::CoverLp(const RegionPool& pool, std::vector<char> open, int max_uncovered)
    : pool_(&pool),
      open_(std::move(open)),
      max_uncovered_(max_uncovered),
      s_(open_.size(), 0),
      y_(open_.size(), 0),
      mean_y_(open_.size(), 0) {
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
  std::vector<StationIdx> num_before(open_.size() + 1, 0);  // open stations before a station
  for (size_t v = 0; v < open_.size(); ++v) {
    if (open_[v]) collected_.stations.push_back(static_cast<StationIdx>(v));
    num_before[v + 1] = num_before[v] + open_[v];
  }
  std::vector<int> num_regions(num_open_ + 1, 0);  // at an open station, as differences
  for (int region = 0; region < pool_->size(); ++region) {
    const size_t first_run = collected_.runs.size();
    int num_stations = 0;
    for (const auto& [station_begin, station_end] : pool_->Runs(region)) {
      const StationIdx begin = num_before[station_begin], end = num_before[station_end];
      if (begin == end) continue;
      num_stations += end - begin;
      ++num_regions[begin];
      --num_regions[end];
      if (collected_.runs.size() > first_run && collected_.runs.back().end == begin) {
        collected_.runs.back().end = end;
      } else {
        collected_.runs.push_back({begin, end});
      }
    }
    if (num_stations == 0) {
      x_[region] = 0;
    } else {
      collected_.entries.push_back({region, first_run, 1.0 / (kDualWeight * num_stations)});
    }
  }
  collected_.entries.push_back({-1, collected_.runs.size(), 0});
  for (int i = 0, num = 0; i < num_open_; ++i) {
    num += num_regions[i];
    collected_.dual_steps.push_back(kDualWeight / (1.0 + num));
  }
}

// Primal step of x against the reduced costs 1 - y(R); `cover_steps` adds up to the cover of each station by
// the extrapolated point 2x' - x.
void CoverLp::StepRegions(Iterates* now) {
  for (int i = 0; i < num_open_; ++i) now->partial_sums[i + 1] = now->partial_sums[i] + now->y[i];
  std::fill(now->cover_steps.begin(), now->cover_steps.end(), 0.0);
  for (size_t i = 0; i + 1 < collected_.entries.size(); ++i) {
    const OpenRegions::Entry& entry = collected_.entries[i];
    const size_t end = collected_.entries[i + 1].first_run;
    double value = 0;
    for (size_t j = entry.first_run; j < end; ++j) {
      const RegionPool::Run& run = collected_.runs[j];
      value += now->partial_sums[run.end] - now->partial_sums[run.begin];
    }
    double& x = x_[entry.region];
    const double next = std::max(0.0, x - (1.0 - value) * entry.step);
    const double extrapolated = 2.0 * next - x;
    x = next;
    mean_x_[entry.region] += next;
    if (extrapolated == 0) continue;
    for (size_t j = entry.first_run; j < end; ++j) {
      now->cover_steps[collected_.runs[j].begin] += extrapolated;
      now->cover_steps[collected_.runs[j].end] -= extrapolated;
    }
  }
}

// Primal step of s against z - y_v, then the dual steps of y and z.
void CoverLp::StepStations(Iterates* now) {
  double num_uncovered = 0, covered = 0;
  for (int i = 0; i < num_open_; ++i) {
    covered += now->cover_steps[i];
    const double next = std::clamp(now->s[i] - (z_ - now->y[i]) / (2.0 * kDualWeight), 0.0, 1.0);
    const double extrapolated = 2.0 * next - now->s[i];
    now->s[i] = next;
    num_uncovered += extrapolated;
    now->y[i] = std::max(0.0, now->y[i] + collected_.dual_steps[i] * (1.0 - covered - extrapolated));
    now->y_sum[i] += now->y[i];
  }
  z_ = std::max(0.0, z_ + kDualWeight / num_open_ * (num_uncovered - max_uncovered_));
}

void CoverLp::Iterate(int num_iterations) {
  CollectOpen();
  mean_x_.assign(pool_->size(), 0);
  mean_y_.assign(open_.size(), 0);
  if (num_open_ == 0 || num_iterations == 0) return;
  Iterates now;
  for (const StationIdx v : collected_.stations) {
    now.y.push_back(y_[v]);
    now.s.push_back(s_[v]);
  }
  now.y_sum.assign(num_open_, 0);
  now.partial_sums.assign(num_open_ + 1, 0);
  now.cover_steps.assign(num_open_ + 1, 0);
  for (int iteration = 0; iteration < num_iterations; ++iteration) {
    StepRegions(&now);
    StepStations(&now);
  }
  for (int i = 0; i < num_open_; ++i) {
    const StationIdx v = collected_.stations[i];
    y_[v] = now.y[i];
    s_[v] = now.s[i];
    mean_y_[v] = now.y_sum[i] / num_iterations;
  }
  for (double& x : mean_x_) x /= num_iterations;
}

}  // namespace cairn::decompose_regions
