#include "stages/decompose_regions/cover/column_generation.h"

#include <algorithm>
#include <functional>
#include <utility>

namespace cairn::decompose_regions {
namespace {

// Station values of at most 1 become multiples of this.
constexpr double kValueUnit = 0x1p-32;
// A region joins the pool when its value exceeds that of every region in it by the value's part 1 / this; for
// exact pricing the bound loses at most this part.
constexpr int64_t kGreedyMargin = 500, kExactMargin = 5000;
// Integer covers also use regions of less value: down to this percentage of the most valuable one of the
// pool, with values changed at random by up to this ratio.
constexpr int64_t kNearlyPercent = 85;
constexpr double kValueSpread = 0.2;

// The certificate of station values, without the largest value of a region.
struct DualValues {
  StationValues values;  // min(y_v, z), whole numbers
  int64_t total = 0;     // of all stations
  int64_t z = 0;
  int64_t covered = 0;  // least total value of the stations that are covered
  int64_t most = 0;     // largest value of a region of the pool
};

DualValues RoundedDual(const std::vector<double>& station_values, const RegionPool& pool, int max_uncovered) {
  DualValues dual;
  for (const double value : station_values) {
    dual.values.push_back(static_cast<int64_t>(std::clamp(value, 0.0, 1.0) / kValueUnit));
  }
  // The best z leaves max_uncovered stations above it.
  StationValues sorted = dual.values;
  const auto cut = sorted.begin() + std::min<size_t>(max_uncovered, sorted.size() - 1);
  std::nth_element(sorted.begin(), cut, sorted.end(), std::greater<>());
  dual.z = *cut;
  for (int64_t& value : dual.values) {
    value = std::min(value, dual.z);
    dual.total += value;
  }
  dual.covered = dual.total - dual.z * max_uncovered;
  std::vector<int64_t> partial_sums = {0};
  for (const int64_t value : dual.values) partial_sums.push_back(partial_sums.back() + value);
  for (int region = 0; region < pool.size(); ++region) {
    int64_t value = 0;
    for (const auto& [begin, end] : pool.Runs(region)) value += partial_sums[end] - partial_sums[begin];
    dual.most = std::max(dual.most, value);
  }
  return dual;
}

int CeilRatio(int64_t numerator, int64_t denominator) {
  return numerator <= 0 || denominator <= 0 ? 0
                                            : static_cast<int>((numerator + denominator - 1) / denominator);
}

using Wide = __int128;

// What a certificate proves, before it is rounded up, as a fraction.
struct Proven {
  Wide regions = 0, unit = 1;
  Proven(const Certificate& certificate, int max_uncovered) {
    if (certificate.most_of_region <= 0) return;
    regions = Wide{certificate.total} - Wide{certificate.most_of_station} * max_uncovered;
    unit = certificate.most_of_region;
  }
  friend bool operator<(const Proven& a, const Proven& b) { return a.regions * b.unit < b.regions * a.unit; }
};

}  // namespace

int LeastNumberOfRegions(const std::vector<Certificate>& parts, int max_uncovered) {
  if (max_uncovered == 0) {
    int least = 0;
    for (const Certificate& part : parts) least += CeilRatio(part.total, part.most_of_region);
    return least;
  }
  // Parts of a region: rounded down, what is lost by a station up.
  constexpr Wide kUnit = Wide{1} << 32;
  struct Share {
    Wide regions = 0, by_station = 0;
  };
  std::vector<Share> shares;
  Wide least = 0;
  for (const Certificate& part : parts) {
    if (part.most_of_region <= 0) continue;
    const Wide most = part.most_of_region;
    shares.push_back({kUnit * part.total / most, (kUnit * part.most_of_station + most - 1) / most});
    least += shares.back().regions;
  }
  std::sort(shares.begin(), shares.end(),
            [](const Share& a, const Share& b) { return a.by_station > b.by_station; });
  Wide num_left = max_uncovered;
  for (const Share& share : shares) {
    if (share.by_station == 0) break;
    const Wide num = std::min(num_left, (share.regions + share.by_station - 1) / share.by_station);
    least -= std::min(share.regions, num * share.by_station);
    num_left -= num;
  }
  return static_cast<int>((least + kUnit - 1) / kUnit);
}

ColumnGeneration::ColumnGeneration(const ReducedWorld& wide, int max_uncovered,
                                   const ColumnGenerationOptions& options)
    : wide_(wide),
      max_uncovered_(max_uncovered),
      options_(options),
      max_new_regions_(
          std::max(options.min_new_regions, static_cast<int>(options.max_new_ratio * wide.num_coverable))),
      pricer_(wide),
      exact_pricer_(wide),
      lp_(pool_, wide.coverable, max_uncovered) {}

int ColumnGeneration::AddMostValuable(const StationValues& values, std::vector<CoreRegion> found) {
  std::vector<std::pair<int64_t, size_t>> order;
  for (size_t i = 0; i < found.size(); ++i) {
    int64_t value = 0;
    for (const StationIdx station : found[i].stations) value += values[station];
    order.emplace_back(-value, i);
  }
  std::sort(order.begin(), order.end());
  int num_new = 0;
  for (const auto& [negative_value, i] : order) {
    if (num_new >= max_new_regions_) break;
    num_new += pool_.Add(std::move(found[i]));
  }
  return num_new;
}

int ColumnGeneration::Price(const CoverLp& lp) {
  const DualValues dual = RoundedDual(lp.station_values(), pool_, lp.max_uncovered());
  if (dual.most == 0) return 0;
  std::vector<CoreRegion> found;
  pricer_.Greedy(dual.values, dual.most + dual.most / kGreedyMargin, &found);
  return AddMostValuable(dual.values, std::move(found));
}

void ColumnGeneration::AddNearlyAsValuable(Random* random) {
  std::vector<double> values = lp_.station_values();
  for (double& value : values) value *= random->Uniform(1 - kValueSpread, 1 + kValueSpread);
  const DualValues dual = RoundedDual(values, pool_, max_uncovered_);
  std::vector<CoreRegion> found;
  pricer_.Greedy(dual.values, dual.most / 100 * kNearlyPercent, &found);
  for (CoreRegion& region : found) pool_.Add(std::move(region));
}

void ColumnGeneration::Run() {
  if (pool_.size() == 0) return;
  for (int round = 0; round < options_.num_rounds && !IsCancelled(); ++round) {
    lp_.Iterate(options_.num_lp_iterations);
    if (Price(lp_) < 5) break;
  }
  RunExactRounds();
}

void ColumnGeneration::LowerMaxUncovered(int max_uncovered) {
  if (max_uncovered >= max_uncovered_) return;
  max_uncovered_ = max_uncovered;
  lp_.set_max_uncovered(max_uncovered);
  RunExactRounds();
}

void ColumnGeneration::RunExactRounds() {
  const int64_t max_work = options_.max_work_ratio * wide_.areas.num_values();
  int64_t total_work = 0;
  for (int round = 0; round < options_.num_exact_rounds && !IsCancelled(); ++round) {
    if (total_work > options_.max_total_work_ratio * wide_.areas.num_values()) break;
    lp_.Iterate(options_.num_exact_iterations);
    const DualValues dual = RoundedDual(lp_.station_values(), pool_, max_uncovered_);
    std::vector<CoreRegion> found;
    const int64_t max_value =
        exact_pricer_.MaxValue(dual.values, dual.most + dual.most / kExactMargin, max_work, &found);
    total_work += exact_pricer_.work();
    lower_bound_ = std::max(lower_bound_, CeilRatio(dual.covered, max_value));
    const Certificate now = {dual.total, dual.z, max_value};
    if (Proven(certificate_, max_uncovered_) < Proven(now, max_uncovered_)) certificate_ = now;
    // Regions that join the pool only lower its optimum.
    const bool is_tight = CeilRatio(dual.covered, dual.most) <= lower_bound_;
    if (AddMostValuable(dual.values, std::move(found)) == 0 || is_tight) break;
  }
}

}  // namespace cairn::decompose_regions
