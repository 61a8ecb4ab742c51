#include "stages/decompose_regions/observed_sights.h"

#include <algorithm>
#include <cmath>

#include "core/camera/camera.h"

namespace cairn::decompose_regions {

Result<std::vector<SightInformation>> ObservedSights(const FeatureClass& feature_class,
                                                     double distinctiveness, const Classes& classes,
                                                     const ChooseFeaturesOptions& options) {
  std::vector<SightInformation> sights;
  for (const Observation& observation : feature_class.observations) {
    const auto image = std::lower_bound(
        classes.images.begin(), classes.images.end(), observation.image_id,
        [](const SurveyImage& survey_image, ImageId id) { return survey_image.image_id < id; });
    if (image == classes.images.end() || image->image_id != observation.image_id) {
      return MakeError(ErrorCode::kInvalidArgument, "class {} is observed in image {}, which has no pose",
                       feature_class.class_id, observation.image_id);
    }
    const auto camera =
        std::lower_bound(classes.cameras.begin(), classes.cameras.end(), image->camera_id,
                         [](const Camera& candidate, CameraId id) { return candidate.camera_id < id; });
    if (camera == classes.cameras.end() || camera->camera_id != image->camera_id) {
      return MakeError(ErrorCode::kInvalidArgument, "image {} is of camera {}, which does not exist",
                       image->image_id, image->camera_id);
    }
    const double sigma_px =
        std::hypot(options.keypoint_sigma_px, options.keypoint_sigma_per_scale * observation.keypoint.scale,
                   feature_class.reprojection_error_px);
    const auto root = InformationRoot(feature_class, image->cam_from_world, sigma_px / camera->MeanFocal(),
                                      distinctiveness);
    if (root) sights.push_back({static_cast<size_t>(image - classes.images.begin()), *root});
  }
  return sights;
}

}  // namespace cairn::decompose_regions
