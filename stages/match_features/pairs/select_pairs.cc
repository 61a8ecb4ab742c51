#include "stages/match_features/pairs/select_pairs.h"

#include <algorithm>
#include <cstdint>

namespace cairn::match_features {

IndexPairs ExhaustivePairs(int num_images) {
  IndexPairs pairs;
  pairs.reserve(static_cast<size_t>(num_images) * std::max(0, num_images - 1) / 2);
  for (int i = 0; i < num_images; ++i) {
    for (int j = i + 1; j < num_images; ++j) pairs.emplace_back(i, j);
  }
  return pairs;
}

IndexPairs SequencePairs(const std::vector<int>& order, int window) {
  IndexPairs pairs;
  const int num_images = static_cast<int>(order.size());
  for (int i = 0; i < num_images; ++i) {
    for (int j = i + 1; j < num_images && j - i <= window; ++j) {
      pairs.emplace_back(std::min(order[i], order[j]), std::max(order[i], order[j]));
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::vector<int> SeedsAmong(const std::vector<int>& ranked, int num_best, int num_spread) {
  const auto num_ranked = static_cast<int64_t>(ranked.size());
  const int64_t num_first = std::min<int64_t>(num_best, num_ranked);
  const int64_t num_others = std::min<int64_t>(num_spread, num_ranked - num_first);
  std::vector<int> seeds(ranked.begin(), ranked.begin() + num_first);
  for (int64_t k = 0; k < num_others; ++k)
    seeds.push_back(ranked[num_first + (2 * k + 1) * (num_ranked - num_first) / (2 * num_others)]);
  return seeds;
}

IndexPairs PairsFromPartners(const std::vector<std::vector<int>>& partners) {
  IndexPairs pairs;
  for (int i = 0; i < static_cast<int>(partners.size()); ++i) {
    for (const int j : partners[i]) pairs.emplace_back(std::min(i, j), std::max(i, j));
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace cairn::match_features
