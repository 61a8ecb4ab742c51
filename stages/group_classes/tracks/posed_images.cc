#include "stages/group_classes/tracks/posed_images.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/parallel.h"
#include "core/camera/panorama.h"

namespace cairn::group_classes {
namespace {

// A turn by a radian lets a tracker drift as a metre of way does; between surveys it starts anew.
constexpr double kMetresPerRadian = 1, kMetresBetweenSurveys = 10, kMinWayM = 1e-4;

struct NamedPose {
  std::string name;
  Pose pose;
};

double Way(const NamedPose& a, const NamedPose& b) {
  const auto view_a = ParsePanoramaViewName(a.name), view_b = ParsePanoramaViewName(b.name);
  if (view_a && view_b && view_a->panorama_name == view_b->panorama_name) return kMinWayM;
  const auto folder = [](const std::string& name) { return name.substr(0, name.find('/') + 1); };
  const double way = CenterErrorM(a.pose, b.pose) +
                     kMetresPerRadian * RadFromDeg(RotationErrorDeg(a.pose, b.pose)) +
                     (folder(a.name) == folder(b.name) ? 0 : kMetresBetweenSurveys);
  return std::max(kMinWayM, way);
}

}  // namespace

PosedImages CollectPosedImages(const MatchedFeatures& matched, const Capture& capture) {
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
  std::optional<NamedPose> before;
  for (size_t i = 0; i < matched.images.size(); ++i) {
    const std::optional<Pose> pose = FindPose(poses, matched.images[i].name);
    if (!pose) continue;
    posed.feature_idx.push_back(static_cast<int>(i));
    posed.camera_idx.push_back(camera_idx.at(matched.images[i].camera_id));
    posed.stated.push_back(*pose);
    const NamedPose here = {matched.images[i].name, *pose};
    posed.way_m.push_back(before ? Way(*before, here) : 0);
    before = here;
  }
  posed.poses = posed.stated;
  return posed;
}

std::optional<PixelRay> RayOf(const MatchedFeatures& matched, const PosedImages& posed,
                              const TrackElement& element) {
  const Keypoint& keypoint =
      matched.features[posed.feature_idx[element.image_idx]].keypoints[element.keypoint_idx];
  return MakePixelRay(posed.cameras[posed.camera_idx[element.image_idx]],
                      Eigen::Vector2d(keypoint.x, keypoint.y));
}

PixelRay RayOfTrack(const MatchedFeatures& matched, const PosedImages& posed, const TrackElement& element) {
  PixelRay lost;
  lost.normal.setZero();
  return RayOf(matched, posed, element).value_or(lost);
}

std::vector<Triangulation> TriangulateTracks(const MatchedFeatures& matched, const std::vector<Track>& tracks,
                                             const PosedImages& posed, const TriangulateOptions& options,
                                             int num_threads) {
  std::vector<Triangulation> triangulations(tracks.size());
  ParallelFor(static_cast<int64_t>(tracks.size()), num_threads, [&](int64_t t) {
    std::vector<PosedRay> rays;
    for (const TrackElement& element : tracks[t])
      rays.push_back({posed.poses[element.image_idx], RayOfTrack(matched, posed, element)});
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
