#include "stages/reconstruct/globally/part_model.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace cairn::reconstruct {
namespace {

constexpr int kMinNumSeen = 15;  // points of an image that stays

}  // namespace

ColmapModel ModelOfPart(const MapperInput& input, const std::vector<int>& images, const ModelProblem& problem,
                        const std::vector<Track>& tracks, const std::vector<Triangulation>& triangulations) {
  ColmapModel model;
  std::vector<int> num_seen(images.size(), 0);
  for (size_t t = 0; t < tracks.size(); ++t) {
    for (const int e : triangulations[t].inliers) ++num_seen[tracks[t][e].image_idx];
  }
  std::vector<int> place(images.size(), -1), order(images.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return images[a] < images[b]; });
  for (const int i : order) {
    if (num_seen[i] < kMinNumSeen) continue;
    const DatabaseImage& listed = input.images[images[i]];
    place[i] = static_cast<int>(model.images.size());
    ModelImage image{.image_id = listed.image_id,
                     .name = listed.name,
                     .camera_id = listed.camera_id,
                     .cam_from_world = problem.cam_from_world[i],
                     .keypoints = {}};
    for (const Keypoint& keypoint : input.keypoints[images[i]])
      image.keypoints.push_back({{keypoint.x, keypoint.y}, kNoPoint});
    model.images.push_back(std::move(image));
    model.cameras.emplace(listed.camera_id, problem.cameras[problem.camera_idx[i]].camera);
  }
  for (size_t t = 0; t < tracks.size(); ++t) {
    std::vector<TrackElement> seen;
    for (const int e : triangulations[t].inliers) {
      if (place[tracks[t][e].image_idx] >= 0) seen.push_back(tracks[t][e]);
    }
    if (seen.size() < 2) continue;
    ModelPoint point{.point_id = model.points.size() + 1,
                     .position = triangulations[t].position,
                     .error_px = triangulations[t].rms_error_px,
                     .track = {}};
    for (const TrackElement& element : seen) {
      ModelImage& image = model.images[place[element.image_idx]];
      image.keypoints[element.keypoint_idx].point_id = point.point_id;
      point.track.emplace_back(image.image_id, element.keypoint_idx);
    }
    model.points.push_back(std::move(point));
  }
  return model;
}

}  // namespace cairn::reconstruct
