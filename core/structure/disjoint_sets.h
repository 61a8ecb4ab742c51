#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

namespace cairn {

// Sets of the items 0, 1, ..., each by its smallest item (union-find).
class DisjointSets {
 public:
  explicit DisjointSets(int num_items) : parents_(num_items) {
    std::iota(parents_.begin(), parents_.end(), 0);
  }

  // Of an item that Find() will be asked for soon.
  void Prefetch(int item) const { __builtin_prefetch(&parents_[item]); }
  // The smallest item of the set.
  int Find(int item) {
    while (parents_[item] != item) item = parents_[item] = parents_[parents_[item]];
    return item;
  }
  void Join(int a, int b) {
    const int root_a = Find(a), root_b = Find(b);
    parents_[std::max(root_a, root_b)] = std::min(root_a, root_b);
  }

 private:
  std::vector<int> parents_;
};

}  // namespace cairn
