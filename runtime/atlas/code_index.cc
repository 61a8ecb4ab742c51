#include "runtime/atlas/code_index.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

namespace cairn {
namespace {

constexpr int kPrefixBits = 16;
// Bits that a landmark's next sighting has otherwise are those near the median (DescriptorCode): more is
// likelier another landmark.
constexpr int kMaxCost = 25;
constexpr size_t kMaxNumFeatures = 600;

uint32_t PrefixOf(uint32_t code) { return code >> (kNumCodeBits - kPrefixBits); }

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
  // Of each landmark that is in the image: the part of a feature by which it counts.
  std::map<int32_t, double> weight_of_entry;
  for (const size_t feature : LargestFeatures(features)) {
    const DescriptorCode code =
        CodeOf(code_book_, features.descriptors.data() + feature * kDescriptorDim);
    const std::vector<int32_t> hits = Find(code);
    std::set<int32_t> maps;
    for (const int32_t hit : hits) maps.insert(map_of_place_[entries_[hit].place]);
    for (const int32_t hit : hits) {
      double& weight = weight_of_entry[hit];
      weight = std::max(weight, 1 / static_cast<double>(maps.size()));
    }
  }
  std::vector<double> score_of_place(map_of_place_.size() + 1);
  for (const auto& [entry, weight] : weight_of_entry) score_of_place[entries_[entry].place] += weight;
  std::map<int32_t, double> score_of_map;
  for (size_t place = 0; place < map_of_place_.size(); ++place) {
    // An image shows a place and what lies beside it.
    double score = score_of_place[place];
    if (place + 1 < map_of_place_.size() && map_of_place_[place + 1] == map_of_place_[place])
      score += score_of_place[place + 1];
    if (score > 0) {
      double& best = score_of_map[map_of_place_[place]];
      best = std::max(best, score);
    }
  }
  std::vector<MapScore> ranked;
  for (const auto& [map, score] : score_of_map) ranked.push_back({map, score});
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const MapScore& a, const MapScore& b) { return a.score > b.score; });
  return ranked;
}

}  // namespace cairn
