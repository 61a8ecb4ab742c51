#include "stages/emit_map/choose/fewest_size.h"

#include <algorithm>
#include <cmath>

namespace cairn::emit_map {

std::vector<double> IsotonicRegression(const std::vector<double>& values) {
  struct Pool {
    double sum;
    size_t count;
    double Mean() const { return sum / static_cast<double>(count); }
  };
  std::vector<Pool> pools;
  for (const double value : values) {
    pools.push_back({value, 1});
    while (pools.size() > 1 && pools[pools.size() - 2].Mean() > pools.back().Mean()) {
      const Pool last = pools.back();
      pools.pop_back();
      pools.back().sum += last.sum;
      pools.back().count += last.count;
    }
  }
  std::vector<double> fitted;
  for (const Pool& pool : pools) fitted.insert(fitted.end(), pool.count, pool.Mean());
  return fitted;
}

std::vector<SizeTrial> WithoutChance(const std::vector<TriedSize>& tried) {
  std::vector<SizeTrial> trials;
  for (const TriedSize& size : tried) trials.push_back(size.trial);
  const size_t num_images = tried.empty() ? 0 : tried.front().is_right.size();
  for (size_t image = 0; image < num_images; ++image) {
    bool was_right = false, is_by_chance = false;
    for (const TriedSize& size : tried) {
      is_by_chance = is_by_chance || (was_right && size.is_right[image] == 0);
      was_right = was_right || size.is_right[image] != 0;
    }
    if (!is_by_chance) continue;
    for (size_t n = 0; n < tried.size(); ++n) trials[n].num_right += tried[n].is_right[image] == 0 ? 1 : 0;
  }
  return trials;
}

std::optional<size_t> FewestThatDo(std::vector<SizeTrial> trials, const SizeTerms& terms) {
  std::sort(trials.begin(), trials.end(),
            [](const SizeTrial& a, const SizeTrial& b) { return a.num_landmarks < b.num_landmarks; });
  std::vector<double> num_right, gains;  // gain: less error
  for (const SizeTrial& trial : trials) {
    num_right.push_back(trial.num_right);
    gains.push_back(-trial.log_error_ratio);
  }
  num_right = IsotonicRegression(num_right);
  gains = IsotonicRegression(gains);
  const double least_gain = -terms.max_log_error_ratio;
  size_t i = 0;
  while (i < trials.size() && (num_right[i] < terms.min_num_right || gains[i] < least_gain)) ++i;
  if (i == trials.size()) return std::nullopt;
  const auto larger = static_cast<double>(trials[i].num_landmarks);
  if (i == 0 || num_right[i - 1] < terms.min_num_right) return trials[i].num_landmarks;
  const auto smaller = static_cast<double>(trials[i - 1].num_landmarks);
  const double part = (least_gain - gains[i - 1]) / (gains[i] - gains[i - 1]);
  return static_cast<size_t>(std::lround(smaller * std::pow(larger / smaller, part)));
}

}  // namespace cairn::emit_map
