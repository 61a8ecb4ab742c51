#include "runtime/atlas/code_index.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

namespace cairn {
namespace {

constexpr int kPrefixBits = 16;
// Bits that a landmark's next sighting has otherwise are those near the median (DescriptorCode): more is
// likelier another landmark.
constexpr int kMaxCost = 25;
constexpr size_t kMaxNumFeatures = 1000;
// Where an image shows next to nothing.
constexpr double kLeastByChance = 0.05;

uint32_t PrefixOf(uint32_t code) { return code >> (kNumCodeBits - kPrefixBits); }

// That a place has so many, where others have this number by chance: Chernoff's bound of a Poisson number's
// tail, negative where it has fewer.
double EvidenceOf(double num, double by_chance) {
  const double evidence = (num > 0 ? num * std::log(num / by_chance) : 0) - num + by_chance;
  return num > by_chance ? evidence : -evidence;
}

// The largest features' indices; among equal ones the first.
std::vector<size_t> LargestFeatures(const Features& features) {
  std::vector<size_t> order(features.keypoints.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return features.keypoints[a].scale > features.keypoints[b].scale;
  });
  order.resize(std::min(order.size(), kMaxNumFeatures));
  return order;
}

}  // namespace

CodeIndex::CodeIndex(const AtlasRows& atlas) : code_book_(atlas.code_book) {
  for (size_t map = 0; map < atlas.maps.size(); ++map) {
    for (const std::vector<uint32_t>& place : atlas.maps[map].places) {
      for (const uint32_t code : place)
        entries_.push_back({code, static_cast<int32_t>(map_of_place_.size())});
      map_of_place_.push_back(static_cast<int32_t>(map));
    }
  }
  std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return a.code != b.code ? a.code < b.code : a.place < b.place;
  });
  first_.assign((size_t{1} << kPrefixBits) + 1, 0);
  for (const Entry& entry : entries_) ++first_[PrefixOf(entry.code) + 1];
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
}

std::vector<int32_t> CodeIndex::Find(const DescriptorCode& code) const {
  std::vector<int32_t> found;
  for (const uint32_t prefix : NearPrefixes(code, kPrefixBits, kMaxCost)) {
    for (int32_t i = first_[prefix]; i < first_[prefix + 1]; ++i) {
      if (CostOf(code, entries_[i].code) <= kMaxCost) found.push_back(i);
    }
  }
  return found;
}

std::vector<int32_t> CodeIndex::MapsWith(const DescriptorCode& code) const {
  std::set<int32_t> maps;
  for (const int32_t entry : Find(code)) maps.insert(map_of_place_[entries_[entry].place]);
  return {maps.begin(), maps.end()};
}

std::vector<MapScore> CodeIndex::Rank(const Features& features) const {
  if (features.keypoints.empty()) return {};
  // Of each landmark that is in the image: a feature that shows it, of those that fewest maps have.
  struct Shown {
    int32_t feature;
    double weight;  // a feature that several maps have counts by as many parts
  };
  std::map<int32_t, Shown> shown;  // by entry
  for (const size_t feature : LargestFeatures(features)) {
    const DescriptorCode code =
        CodeOf(code_book_, features.descriptors.data() + feature * kSiftDescriptorDim);
    const std::vector<int32_t> hits = Find(code);
    std::set<int32_t> maps;
    for (const int32_t hit : hits) maps.insert(map_of_place_[entries_[hit].place]);
    for (const int32_t hit : hits) {
      const Shown here{static_cast<int32_t>(feature), 1 / static_cast<double>(maps.size())};
      const auto [known, is_new] = shown.emplace(hit, here);
      if (!is_new && here.weight > known->second.weight) known->second = here;
    }
  }
  std::vector<double> sum_of_place(map_of_place_.size());
  double sum = 0;
  for (const auto& [entry, each] : shown) {
    sum_of_place[entries_[entry].place] += each.weight;
    sum += each.weight;
  }
  // An image shows a place and what lies beside it.
  const auto is_followed = [&](size_t place) {
    return place + 1 < map_of_place_.size() && map_of_place_[place + 1] == map_of_place_[place];
  };
  // What two places have by chance, as nearly all of them do.
  const double by_chance =
      std::max(kLeastByChance, 2 * sum / static_cast<double>(std::max<size_t>(1, map_of_place_.size())));
  struct Best {
    size_t place = 0;
    double sum = 0;
    int num_places = 0;
  };
  std::map<int32_t, Best> best_of_map;
  for (size_t place = 0; place < map_of_place_.size(); ++place) {
    Best& best = best_of_map[map_of_place_[place]];
    ++best.num_places;
    const double here = sum_of_place[place] + (is_followed(place) ? sum_of_place[place + 1] : 0);
    if (here > best.sum) best = {place, here, best.num_places};
  }
  std::vector<MapScore> ranked;
  for (const auto& [map, best] : best_of_map) {
    MapScore score{.map = map,
                   .score = EvidenceOf(best.sum, by_chance) - std::log(static_cast<double>(best.num_places))};
    for (const auto& [entry, each] : shown) {
      const auto place = static_cast<size_t>(entries_[entry].place);
      const bool is_best = place == best.place || (is_followed(best.place) && place == best.place + 1);
      if (best.sum > 0 && is_best) score.features.push_back(each.feature);
    }
    std::sort(score.features.begin(), score.features.end());
    score.features.erase(std::unique(score.features.begin(), score.features.end()), score.features.end());
    ranked.push_back(std::move(score));
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const MapScore& a, const MapScore& b) { return a.score > b.score; });
  return ranked;
}

}  // namespace cairn
