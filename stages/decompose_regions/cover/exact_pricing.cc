#include "stages/decompose_regions/cover/exact_pricing.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <numeric>
#include <utility>

namespace cairn::decompose_regions {
namespace {

constexpr size_t kBitsInWord = 64;
// When the work is spent, the threshold rises by its part 1 / this, for a part 1 / this of the work.
constexpr int64_t kRaise = 32;

// Calls `visit` with the index of each bit of words[i] & mask[i].
template <typename Visitor>
void ForEachBit(const uint64_t* words, const std::vector<uint64_t>& mask, Visitor visit) {
  for (size_t i = 0; i < mask.size(); ++i) {
    for (uint64_t word = words[i] & mask[i]; word != 0; word &= word - 1) {
      visit(kBitsInWord * i + static_cast<size_t>(std::countr_zero(word)));
    }
  }
}

int NumCommon(const uint64_t* words, const std::vector<uint64_t>& mask) {
  int num = 0;
  for (size_t i = 0; i < mask.size(); ++i) num += std::popcount(words[i] & mask[i]);
  return num;
}

}  // namespace

ExactPricer::ExactPricer(const ReducedWorld& wide)
    : wide_(wide),
      finder_(wide),
      components_(wide.neighbours),
      num_shared_(wide.num_stations(), 0),
      num_seen_(wide.num_stations(), 0),
      local_(wide.areas.size(), -1) {}

int64_t ExactPricer::MaxValue(const StationValues& values, int64_t threshold, int64_t max_work,
                              std::vector<CoreRegion>* found) {
  values_ = &values;
  least_ = threshold_ = threshold;
  work_ = 0;
  work_left_ = max_work;
  more_work_ = max_work / kRaise;
  int64_t max_value = threshold;
  was_anchor_.assign(wide_.num_stations(), 0);
  KeepLive();
  for (const StationIdx anchor : AnchorOrder()) {
    anchor_ = anchor;
    best_ = {};
    threshold_ = least_;
    const std::vector<StationIdx> sharing = Sharing(anchor);
    if (TotalValue(anchor, sharing) > threshold_) Search(Root(anchor, sharing));
    was_anchor_[anchor] = 1;
    max_value = std::max(max_value, threshold_);
    if (!best_.stations.empty()) found->push_back(std::move(best_));
  }
  return std::max(max_value, least_);
}

// A feature that is not worth more than the threshold is in no region that is.
void ExactPricer::KeepLive() {
  live_areas_ = IndexLists();
  std::vector<StationIdx> live;
  for (int32_t feature = 0; feature < wide_.areas.size(); ++feature) {
    live.clear();
    int64_t total = 0;
    for (const StationIdx station : wide_.areas[feature]) {
      if ((*values_)[station] == 0) continue;
      live.push_back(station);
      total += (*values_)[station];
    }
    if (total <= threshold_) live.clear();
    live_areas_.Append(live);
  }
  live_sets_ = live_areas_.Transposed(wide_.num_stations());
}

// Stations that share k features with the anchor and were no anchors yet, itself excluded, ascending.
std::vector<StationIdx> ExactPricer::Sharing(StationIdx anchor) {
  sharing_.clear();
  for (const int32_t feature : live_sets_[anchor]) {
    for (const StationIdx station : live_areas_[feature]) {
      if (num_shared_[station]++ == 0) sharing_.push_back(station);
    }
    Spend(static_cast<int64_t>(live_areas_[feature].size()));
  }
  std::vector<StationIdx> stations;
  for (const StationIdx station : sharing_) {
    if (num_shared_[station] >= wide_.k && !was_anchor_[station] && station != anchor)
      stations.push_back(station);
    num_shared_[station] = 0;
  }
  std::sort(stations.begin(), stations.end());
  return stations;
}

// Value of the anchor and other stations.
int64_t ExactPricer::TotalValue(StationIdx anchor, const std::vector<StationIdx>& others) const {
  int64_t value = (*values_)[anchor];
  for (const StationIdx station : others) value += (*values_)[station];
  return value;
}

// Anchors of little value around them first: their regions are soon ruled out, and the others then have fewer
// stations left.
std::vector<StationIdx> ExactPricer::AnchorOrder() {
  std::vector<std::pair<int64_t, StationIdx>> order;
  for (StationIdx anchor = 0; anchor < wide_.num_stations(); ++anchor) {
    if (static_cast<int>(live_sets_[anchor].size()) < wide_.k) continue;
    const int64_t value = TotalValue(anchor, Sharing(anchor));
    if (value > threshold_) order.emplace_back(value, anchor);
  }
  std::sort(order.begin(), order.end());
  std::vector<StationIdx> anchors;
  for (const auto& [value, anchor] : order) anchors.push_back(anchor);
  return anchors;
}

ExactPricer::Node ExactPricer::Root(StationIdx anchor, const std::vector<StationIdx>& stations) {
  const auto features = live_sets_[anchor];
  num_words_ = features.size() / kBitsInWord + 1;
  losses_.assign(features.size(), 0);
  Node root;
  root.features.assign(num_words_, 0);
  root.num_features = static_cast<int>(features.size());
  for (size_t i = 0; i < features.size(); ++i) {
    local_[features[i]] = static_cast<int32_t>(i);
    root.features[i / kBitsInWord] |= uint64_t{1} << i % kBitsInWord;
  }
  root.covered = (*values_)[anchor];
  missing_.clear();
  for (const StationIdx station : stations) {
    root.open.push_back({(*values_)[station], static_cast<int32_t>(root.open.size()), 0});
    const size_t first_word = missing_.size();
    missing_.insert(missing_.end(), root.features.begin(), root.features.end());
    for (const int32_t feature : live_sets_[station]) {
      if (local_[feature] < 0) continue;
      const auto bit = static_cast<size_t>(local_[feature]);
      missing_[first_word + bit / kBitsInWord] &= ~(uint64_t{1} << bit % kBitsInWord);
    }
    Spend(static_cast<int64_t>(live_sets_[station].size()));
  }
  for (const int32_t feature : features) local_[feature] = -1;
  return root;
}

// After the work is spent, regions of a somewhat larger value are no longer told from each other.
void ExactPricer::Spend(int64_t work) {
  work_ += work;
  work_left_ -= work;
  if (work_left_ > 0) return;
  least_ += least_ / kRaise + 1;
  threshold_ = std::max(threshold_, least_);
  work_left_ = more_work_;
}

void ExactPricer::Search(Node node) {
  while (Narrow(&node)) {
    if (node.total - LeastLoss(node) <= threshold_) return;
    const std::vector<int32_t> features = FeaturesWithoutLoss(node);
    if (static_cast<int>(features.size()) >= wide_.k) {
      if (Close(features, node.total)) return;
      if (node.open.empty()) {
        Divide(features, 0);
        return;
      }
    }
    // Both branches lose much: one the station's value, the other the features that it does not see.
    const auto most =
        std::max_element(node.open.begin(), node.open.end(), [](const OpenStation& a, const OpenStation& b) {
          return a.value * a.num_missing < b.value * b.num_missing;
        });
    Node with = node;
    for (size_t i = 0; i < num_words_; ++i) with.features[i] &= ~missing_[most->station * num_words_ + i];
    with.num_features -= most->num_missing;
    Search(std::move(with));
    node.open.erase(most);
  }
}

// Takes out what no region worth more than the threshold has, until nothing changes.  False if there is none.
bool ExactPricer::Narrow(Node* node) {
  for (;;) {
    if (node->num_features < wide_.k) return false;
    node->total = node->covered;
    size_t num_open = 0;
    for (OpenStation open : node->open) {
      open.num_missing = NumCommon(&missing_[open.station * num_words_], node->features);
      if (node->num_features - open.num_missing < wide_.k) continue;
      node->total += open.value;
      if (open.num_missing == 0) {
        node->covered += open.value;
      } else {
        node->open[num_open++] = open;
      }
    }
    Spend(static_cast<int64_t>(node->open.size() * num_words_) + 1);
    node->open.resize(num_open);
    if (node->total <= threshold_) return false;
    if (!DropFeatures(node)) return true;
  }
}

// Drops the features that lose too much, and those that a station too valuable to leave out does not see.
bool ExactPricer::DropFeatures(Node* node) {
  const int64_t slack = node->total - threshold_;
  std::fill(losses_.begin(), losses_.end(), 0);
  for (const OpenStation& open : node->open) {
    ForEachBit(&missing_[open.station * num_words_], node->features, [&](size_t feature) {
      losses_[feature] = open.value >= slack ? slack : losses_[feature] + open.value;
    });
    Spend(open.num_missing);
  }
  const int num_before = node->num_features;
  for (size_t feature = 0; feature < losses_.size(); ++feature) {
    uint64_t& word = node->features[feature / kBitsInWord];
    const uint64_t bit = uint64_t{1} << feature % kBitsInWord;
    if ((word & bit) == 0 || losses_[feature] < slack) continue;
    word &= ~bit;
    --node->num_features;
  }
  return node->num_features < num_before;
}

// Least value of the open stations that do not see some of any k features.
int64_t ExactPricer::LeastLoss(const Node& node) {
  std::vector<int64_t> shares(losses_.size(), 0);
  for (const OpenStation& open : node.open) {
    const int64_t share = open.value / open.num_missing;
    ForEachBit(&missing_[open.station * num_words_], node.features,
               [&](size_t feature) { shares[feature] += share; });
    Spend(open.num_missing);
  }
  shares_.clear();
  ForEachBit(node.features.data(), node.features,
             [&](size_t feature) { shares_.push_back(shares[feature]); });
  std::nth_element(shares_.begin(), shares_.begin() + (wide_.k - 1), shares_.end());
  return std::accumulate(shares_.begin(), shares_.begin() + wide_.k, int64_t{0});
}

// REQUIRES: losses_ are the node's
std::vector<int32_t> ExactPricer::FeaturesWithoutLoss(const Node& node) const {
  std::vector<int32_t> features;
  ForEachBit(node.features.data(), node.features, [&](size_t feature) {
    if (losses_[feature] == 0) features.push_back(live_sets_[anchor_][feature]);
  });
  return features;
}

// The region of the k features that most stations see, of those that all stations of a node see.  False if
// it is worth less than these, since it does not hold together.
bool ExactPricer::Close(std::vector<int32_t> features, int64_t total) {
  std::stable_sort(features.begin(), features.end(),
                   [&](int32_t a, int32_t b) { return wide_.areas[a].size() > wide_.areas[b].size(); });
  features.resize(wide_.k);
  std::sort(features.begin(), features.end());
  for (const int32_t feature : features) Spend(static_cast<int64_t>(wide_.areas[feature].size()));
  for (std::vector<StationIdx>& core : finder_.Cores(features)) {
    if (!std::binary_search(core.begin(), core.end(), anchor_)) continue;
    int64_t value = 0;
    for (const StationIdx station : core) value += (*values_)[station];
    if (value > threshold_) {
      threshold_ = value;
      best_ = {features, std::move(core)};
    }
    return value >= total;
  }
  return false;  // not reached: the anchor lies in one of them
}

// Tries the sets of k of some features: all of them are seen by the same stations, which need not hold
// together.  The first `num_fixed` are in the set.
void ExactPricer::Divide(const std::vector<int32_t>& features, size_t num_fixed) {
  const auto k = static_cast<size_t>(wide_.k);
  if (features.size() == k || num_fixed == k) {
    Close({features.begin(), features.begin() + wide_.k}, 0);
    return;
  }
  if (ReachableValue(features, num_fixed) <= threshold_) return;
  Divide(features, num_fixed + 1);
  std::vector<int32_t> without = features;
  without.erase(without.begin() + static_cast<ptrdiff_t>(num_fixed));
  Divide(without, num_fixed);
}

// The value of the stations that see all features and lie in the anchor's component of the stations whose
// surroundings see the fixed ones and k in all.
int64_t ExactPricer::ReachableValue(const std::vector<int32_t>& features, size_t num_fixed) {
  const auto k = static_cast<int>(wide_.k), num_others = static_cast<int>(features.size());
  std::vector<StationIdx> seen;
  for (size_t i = 0; i < features.size(); ++i) {
    for (const StationIdx station : wide_.whole_areas[features[i]]) {
      if (num_seen_[station] == 0) seen.push_back(station);
      num_seen_[station] += i < num_fixed ? num_others : 1;
    }
    Spend(static_cast<int64_t>(wide_.whole_areas[features[i]].size()));
  }
  const int fixed = static_cast<int>(num_fixed);
  std::vector<StationIdx> passable;
  for (const StationIdx station : seen) {
    if (num_seen_[station] >= fixed * num_others + (k - fixed)) passable.push_back(station);
    num_seen_[station] = 0;
  }
  std::sort(passable.begin(), passable.end());
  const std::vector<StationIdx> seeing = CommonStations(wide_.areas, features);
  int64_t value = 0;
  for (const std::vector<StationIdx>& component : components_.Components(passable)) {
    if (!std::binary_search(component.begin(), component.end(), anchor_)) continue;
    for (const StationIdx station : seeing) {
      if (!was_anchor_[station] && std::binary_search(component.begin(), component.end(), station))
        value += (*values_)[station];
    }
  }
  return value;
}

}  // namespace cairn::decompose_regions
