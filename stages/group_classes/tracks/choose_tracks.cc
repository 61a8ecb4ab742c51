#include "stages/group_classes/tracks/choose_tracks.h"

#include <algorithm>

namespace cairn::group_classes {
namespace {

constexpr size_t kMaxNumObservations = 16;

}  // namespace

std::vector<int> Spread(const std::vector<int>& inliers) {
  if (inliers.size() <= kMaxNumObservations) return inliers;
  std::vector<int> spread;
  for (size_t k = 0; k < kMaxNumObservations; ++k)
    spread.push_back(inliers[k * (inliers.size() - 1) / (kMaxNumObservations - 1)]);
  return spread;
}

std::vector<size_t> ChooseTracks(const std::vector<Track>& tracks,
                                 const std::vector<Triangulation>& triangulations,
                                 const std::vector<char>& is_counted, int num_keypoints) {
  std::vector<size_t> order;
  for (size_t t = 0; t < tracks.size(); ++t) {
    if (triangulations[t].outcome == TriangulateOutcome::kOk) order.push_back(t);
  }
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return triangulations[a].inliers.size() > triangulations[b].inliers.size();
  });
  std::vector<int> num_wanted;  // per image
  for (const char flag : is_counted) num_wanted.push_back(flag != 0 ? num_keypoints : 0);
  std::vector<size_t> chosen;
  for (const size_t t : order) {
    const std::vector<int> spread = Spread(triangulations[t].inliers);
    const auto is_wanted = [&](int i) { return num_wanted[tracks[t][i].image_idx] > 0; };
    if (std::none_of(spread.begin(), spread.end(), is_wanted)) continue;
    for (const int i : spread) --num_wanted[tracks[t][i].image_idx];
    chosen.push_back(t);
  }
  return chosen;
}

}  // namespace cairn::group_classes
