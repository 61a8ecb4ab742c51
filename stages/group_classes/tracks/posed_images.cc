#include "stages/group_classes/tracks/posed_images.h"

#include <cmath>
#include <map>

#include "core/base/parallel.h"
#include "core/camera/panorama.h"

namespace cairn::group_classes {

PosedImages CollectPosedImages(const MatchedFeatures& matched, const Capture& capture, int num_threads) {
  std::map<std::string, Pose> poses;
  for (const CaptureImage& image : capture.images) {
    if (image.cam_from_world) poses.emplace(image.name, *image.cam_from_world);
  }
  PosedImages posed;
  std::map<CameraId, int> camera_idx;
  for (const auto& [camera_id, camera] : matched.cameras) {
    camera_idx.emplace(camera_id, static_cast<int>(posed.cameras.size()));
    posed.cameras.push_back(camera);
  }
  for (size_t i = 0; i < matched.images.size(); ++i) {
    const std::optional<Pose> pose = FindPose(poses, matched.images[i].name);
    if (!pose) continue;
    posed.feature_idx.push_back(static_cast<int>(i));
    posed.camera_idx.push_back(camera_idx.at(matched.images[i].camera_id));
    posed.stated.push_back(*pose);
  }
  posed.poses = posed.stated;
  MakeRays(matched, num_threads, &posed);
  return posed;
}

void MakeRays(const MatchedFeatures& matched, int num_threads, PosedImages* posed) {
  posed->rays.assign(posed->num_images(), {});
  ParallelFor(posed->num_images(), num_threads, [&](int64_t i) {
    const Camera& camera = posed->cameras[posed->camera_idx[i]];
    for (const Keypoint& keypoint : matched.features[posed->feature_idx[i]].keypoints)
      posed->rays[i].push_back(MakePixelRay(camera, Eigen::Vector2d(keypoint.x, keypoint.y)));
  });
}

std::vector<Triangulation> TriangulateTracks(const std::vector<Track>& tracks, const PosedImages& posed,
                                             const TriangulateOptions& options, int num_threads) {
  std::vector<Triangulation> triangulations(tracks.size());
  ParallelFor(static_cast<int64_t>(tracks.size()), num_threads, [&](int64_t t) {
    std::vector<PosedRay> rays;
    for (const TrackElement& element : tracks[t])
      rays.push_back({posed.poses[element.image_idx], *posed.rays[element.image_idx][element.keypoint_idx]});
    triangulations[t] = Triangulate(rays, options);
  });
  return triangulations;
}

double RmsErrorPx(const std::vector<Triangulation>& triangulations) {
  double total = 0, count = 0;
  for (const Triangulation& t : triangulations) {
    if (t.outcome != TriangulateOutcome::kOk) continue;
    total += t.rms_error_px * t.rms_error_px * static_cast<double>(t.inliers.size());
    count += static_cast<double>(t.inliers.size());
  }
  return count > 0 ? std::sqrt(total / count) : 0;
}

}  // namespace cairn::group_classes
