#include "stages/emit_map/leave_out/place_anew.h"

#include <algorithm>
#include <unordered_map>
#include <vector>

#include "core/base/parallel.h"
#include "core/camera/pixel_ray.h"

namespace cairn::emit_map {

void PlaceAnew(const Classes& whole, const TriangulateOptions& options, int num_threads, Classes* rest) {
  std::unordered_map<CameraId, const Camera*> cameras;
  for (const Camera& camera : rest->cameras) cameras[camera.camera_id] = &camera;
  std::unordered_map<ImageId, const SurveyImage*> images;
  for (const SurveyImage& image : rest->images) images[image.image_id] = &image;
  std::unordered_map<ClassId, size_t> num_before;
  for (const FeatureClass& feature : whole.classes)
    num_before[feature.class_id] = feature.observations.size();
  std::vector<char> is_gone(rest->classes.size(), 0);
  ParallelFor(static_cast<int64_t>(rest->classes.size()), num_threads, [&](int64_t i) {
    FeatureClass& feature = rest->classes[i];
    if (feature.observations.size() == num_before.at(feature.class_id)) return;
    std::vector<PosedRay> rays;
    for (const Observation& observation : feature.observations) {
      const SurveyImage& image = *images.at(observation.image_id);
      const auto ray =
          MakePixelRay(*cameras.at(image.camera_id), {observation.keypoint.x, observation.keypoint.y});
      if (ray) rays.push_back({image.cam_from_world, *ray});
    }
    const Triangulation placed = Triangulate(rays, options);
    if (placed.outcome != TriangulateOutcome::kOk) {
      is_gone[i] = 1;
      return;
    }
    feature.position = placed.position;
    feature.covariance = placed.covariance;
    feature.reprojection_error_px = placed.rms_error_px;
  });
  std::vector<FeatureClass> left;
  for (size_t i = 0; i < is_gone.size(); ++i) {
    if (is_gone[i] == 0) left.push_back(std::move(rest->classes[i]));
  }
  rest->classes = std::move(left);
}

}  // namespace cairn::emit_map
