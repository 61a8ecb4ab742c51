#include "core/structure/union_matches.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/structure/disjoint_sets.h"

namespace cairn {
namespace {

// Disjoint sets that know their keypoints.
class TrackSets {
 public:
  explicit TrackSets(const std::vector<int>& num_keypoints)
      : sets_(std::accumulate(num_keypoints.begin(), num_keypoints.end(), 0)) {
    for (size_t image = 0; image < num_keypoints.size(); ++image) {
      first_node_.push_back(static_cast<int>(elements_.size()));
      for (int k = 0; k < num_keypoints[image]; ++k) {
        elements_.push_back({static_cast<int32_t>(image), static_cast<KeypointIdx>(k)});
      }
    }
    members_.resize(elements_.size());
  }

  int NodeOf(const TrackElement& element) const {
    return first_node_[element.image_idx] + static_cast<int>(element.keypoint_idx);
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

  std::vector<int> first_node_;
  std::vector<TrackElement> elements_;
  DisjointSets sets_;
  std::vector<Track> members_;  // at the first node of each set of two or more
};

}  // namespace

std::vector<Track> UnionMatches(const std::vector<int>& num_keypoints, std::vector<ScoredMatch> matches,
                                int64_t* num_conflicts) {
  std::sort(matches.begin(), matches.end(), [](const ScoredMatch& a, const ScoredMatch& b) {
    return std::tie(b.dot_product, a.element1, a.element2) < std::tie(a.dot_product, b.element1, b.element2);
  });
  TrackSets sets(num_keypoints);
  *num_conflicts = 0;
  for (const ScoredMatch& match : matches) {
    // [Sala06 §VI-B] keypoints are equivalent where verified matches join them, not by their distance alone
    if (!sets.Union(sets.NodeOf(match.element1), sets.NodeOf(match.element2))) ++*num_conflicts;
  }
  return sets.Tracks();
}

}  // namespace cairn
