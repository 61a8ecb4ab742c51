#include "stages/group_classes/adjust/parts.h"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace cairn::group_classes {
namespace {

constexpr int kMinNumImagesOfPart = 5;

}  // namespace

std::vector<int> NumPartsOfRounds(int num_images, int num_images_at_once) {
  std::vector<int> rounds;
  if (num_images <= num_images_at_once) return rounds;
  int num_parts = 1;
  while (num_images > num_images_at_once / 3 * num_parts) num_parts *= 2;
  rounds.push_back(num_parts);
  const int small = std::max(kMinNumImagesOfPart, num_images_at_once / 12);
  while (num_images > small * num_parts) rounds.push_back(num_parts *= 2);
  std::reverse(rounds.begin(), rounds.end());
  return rounds;
}

std::vector<int> BeginsOfParts(int num_images, int num_parts) {
  std::vector<int> begins;
  for (int64_t p = 0; p <= num_parts; ++p) begins.push_back(static_cast<int>(p * num_images / num_parts));
  return begins;
}

std::vector<std::vector<Track>> SplitTracks(const std::vector<Track>& tracks,
                                            const std::vector<int>& begins) {
  std::vector<std::vector<Track>> of_parts(begins.size() - 1);
  for (const Track& track : tracks) {
    for (auto element = track.begin(); element != track.end();) {
      const auto end = std::upper_bound(begins.begin(), begins.end(), element->image_idx);
      Track kept;
      for (; element != track.end() && element->image_idx < *end; ++element)
        kept.push_back({element->image_idx - *(end - 1), element->keypoint_idx});
      if (kept.size() >= 2) of_parts[end - 1 - begins.begin()].push_back(std::move(kept));
    }
  }
  return of_parts;
}

PosesOfPart JoinParts(const std::vector<PosesOfPart>& parts, const std::vector<Pose>& before) {
  PosesOfPart whole;
  Pose part_from_world;
  for (const PosesOfPart& part : parts) {
    const size_t begin = whole.poses.size();
    if (begin > 0) part_from_world = before[begin - 1].Inverse() * whole.drifted.back();
    for (size_t i = 0; i < part.poses.size(); ++i) {
      whole.poses.push_back(part.poses[i] * part_from_world);
      whole.drifted.push_back(part.drifted[i] * part_from_world);
    }
  }
  return whole;
}

}  // namespace cairn::group_classes
