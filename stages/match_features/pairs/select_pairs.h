#pragma once

#include <utility>
#include <vector>

namespace cairn::match_features {

// Index pairs (i < j), ascending.
using IndexPairs = std::vector<std::pair<int, int>>;
IndexPairs ExhaustivePairs(int num_images);
// Each image with its `window` successors in `order`, a permutation of the image indices.
IndexPairs SequencePairs(const std::vector<int>& order, int window);

// Of partners by rank the first `num_best`, and `num_spread` evenly spaced in the ranks of the others: the
// first may all be of one pass along a path, the others find the passes before and after.
std::vector<int> SeedsAmong(const std::vector<int>& ranked, int num_best, int num_spread);

// Pairs (i, j) of which one is among the partners of the other, i < j, ascending, each once.
IndexPairs PairsFromPartners(const std::vector<std::vector<int>>& partners);

}  // namespace cairn::match_features
