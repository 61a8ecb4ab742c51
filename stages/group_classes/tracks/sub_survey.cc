#include "stages/group_classes/tracks/sub_survey.h"

#include <algorithm>
#include <numeric>

namespace cairn::group_classes {
namespace {

// Fewest images of a camera that are learnt from, where it has as many.
constexpr size_t kMinNumLearnt = 24;

}  // namespace

PosedImages SelectImages(const PosedImages& all, const std::vector<int>& images) {
  PosedImages selected;
  selected.cameras = all.cameras;
  selected.camera_from_given = all.camera_from_given;
  for (size_t k = 0; k < images.size(); ++k) {
    const int i = images[k];
    // What lies between was driven, too: two images of one place may be a whole loop apart.
    const auto before = all.way_m.begin() + (k == 0 ? i : images[k - 1]) + 1;
    selected.way_m.push_back(k == 0 ? 0 : std::accumulate(before, all.way_m.begin() + i + 1, 0.0));
    selected.feature_idx.push_back(all.feature_idx[i]);
    selected.camera_idx.push_back(all.camera_idx[i]);
    selected.stated.push_back(all.stated[i]);
    selected.poses.push_back(all.poses[i]);
  }
  return selected;
}

SubSurvey Restrict(const PosedImages& all, const std::vector<Track>& tracks, const std::vector<int>& images) {
  SubSurvey sub = {SelectImages(all, images), {}};
  std::vector<int> new_idx(all.num_images(), -1);
  for (size_t i = 0; i < images.size(); ++i) new_idx[images[i]] = static_cast<int>(i);
  for (const Track& track : tracks) {
    Track kept;
    for (const TrackElement& element : track) {
      if (new_idx[element.image_idx] >= 0) kept.push_back({new_idx[element.image_idx], element.keypoint_idx});
    }
    if (kept.size() >= 2) sub.tracks.push_back(std::move(kept));
  }
  return sub;
}

std::vector<int> ImagesToLearnFrom(const PosedImages& posed, int num_images) {
  std::vector<std::vector<int>> of_camera(posed.cameras.size());
  for (int i = 0; i < posed.num_images(); ++i) of_camera[posed.camera_idx[i]].push_back(i);
  const auto num_used = std::count_if(of_camera.begin(), of_camera.end(),
                                      [](const std::vector<int>& images) { return !images.empty(); });
  const size_t each = std::max<size_t>(kMinNumLearnt, num_images / std::max<int64_t>(1, num_used));
  std::vector<int> chosen;
  for (const std::vector<int>& images : of_camera) {
    const size_t length = each / 2;
    if (images.size() <= each) {
      chosen.insert(chosen.end(), images.begin(), images.end());
      continue;
    }
    for (const size_t part : {1, 3}) {
      const size_t middle = part * images.size() / 4;
      const size_t begin = middle > length / 2 ? middle - length / 2 : 0;
      for (size_t i = begin; i < std::min(begin + length, images.size()); ++i) chosen.push_back(images[i]);
    }
  }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  return chosen;
}

}  // namespace cairn::group_classes
