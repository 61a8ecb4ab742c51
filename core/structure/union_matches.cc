#include "core/structure/union_matches.h"

#include <algorithm>
#include <tuple>

#include "core/structure/disjoint_sets.h"

namespace cairn {
namespace {

// Disjoint sets that know their keypoints.
class TrackSets {
 public:
  // first_keypoint: per image, counted over all; then the number of all.
  explicit TrackSets(const std::vector<int32_t>& first_keypoint) : sets_(first_keypoint.back()) {
    elements_.reserve(first_keypoint.back());
    for (size_t image = 0; image + 1 < first_keypoint.size(); ++image) {
      for (int32_t k = 0; k < first_keypoint[image + 1] - first_keypoint[image]; ++k)
        elements_.push_back({static_cast<int32_t>(image), static_cast<KeypointIdx>(k)});
    }
    members_.resize(elements_.size());
  }

  // False when the two sets hold different keypoints of one image.
  bool Union(int node1, int node2) {
    const int root1 = sets_.Find(node1), root2 = sets_.Find(node2);
    if (root1 == root2) return true;
    Track merged;
    const Track track1 = TrackOf(root1), track2 = TrackOf(root2);
    merged.reserve(track1.size() + track2.size());
    std::merge(track1.begin(), track1.end(), track2.begin(), track2.end(), std::back_inserter(merged));
    const auto same_image = [](const TrackElement& a, const TrackElement& b) {
      return a.image_idx == b.image_idx;
    };
    if (std::adjacent_find(merged.begin(), merged.end(), same_image) != merged.end()) return false;
    sets_.Join(root1, root2);
    Track().swap(members_[std::max(root1, root2)]);
    members_[std::min(root1, root2)] = std::move(merged);
    return true;
  }

  std::vector<Track> Tracks() {
    std::vector<Track> tracks;
    for (Track& track : members_) {
      if (!track.empty()) tracks.push_back(std::move(track));
    }
    std::sort(tracks.begin(), tracks.end());
    return tracks;
  }

 private:
  // A set that was never joined has no member list.
  Track TrackOf(int root) const { return members_[root].empty() ? Track{elements_[root]} : members_[root]; }

  std::vector<TrackElement> elements_;
  DisjointSets sets_;
  std::vector<Track> members_;  // at the first node of each set of two or more
};

}  // namespace

ScoredMatches::ScoredMatches(const std::vector<int>& num_keypoints) : first_keypoint_{0} {
  for (const int num : num_keypoints) first_keypoint_.push_back(first_keypoint_.back() + num);
}

void ScoredMatches::Add(const TrackElement& element1, const TrackElement& element2, int32_t dot_product) {
  const auto keypoint = [&](const TrackElement& element) {
    return first_keypoint_[element.image_idx] + static_cast<int32_t>(element.keypoint_idx);
  };
  matches_.push_back({keypoint(element1), keypoint(element2), dot_product});
}

std::vector<Track> UnionMatches(ScoredMatches matches, int64_t* num_conflicts) {
  using Match = ScoredMatches::Match;
  std::sort(matches.matches_.begin(), matches.matches_.end(), [](const Match& a, const Match& b) {
    return std::tie(b.dot_product, a.keypoint1, a.keypoint2) <
           std::tie(a.dot_product, b.keypoint1, b.keypoint2);
  });
  TrackSets sets(matches.first_keypoint_);
  *num_conflicts = 0;
  for (const Match& match : matches.matches_) {
    // [Sala06 §VI-B] keypoints are equivalent where verified matches join them, not by their distance alone
    if (!sets.Union(match.keypoint1, match.keypoint2)) ++*num_conflicts;
  }
  std::vector<Match>().swap(matches.matches_);
  return sets.Tracks();
}

}  // namespace cairn
