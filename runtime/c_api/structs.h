#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "runtime/c_api/cairn.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/map.h"
#include "runtime/map/update_map.h"
#include "runtime/track/camera_motion.h"
#include "runtime/visual_map/visual_estimate.h"

// Between the structs of the C API and the runtime's types.
namespace cairn {

// The caller's pixels, not copied.
Result<cv::Mat> PixelsOf(const cairn_image* image);

// What the caller requires of a map that is opened or that an update brings.
struct GivenOptions {
  MapOptions map;
  UpdateOptions update;
};
// NULL: the defaults.  Callers built with an earlier release give the fields that it had.
Result<GivenOptions> OptionsOf(const cairn_map_options* options);

// NULL: none.
Result<std::optional<Camera>> GivenCameraOf(const cairn_camera* given);
// NULL: the survey's camera of the image's size.
Result<Camera> CameraOf(const cairn_camera* given, const Map& map, const cv::Mat& grey);

// What the cameras of a rig see; pixels are not copied.
Result<std::vector<RigImage>> RigImagesOf(const cairn_rig_image* const* images, int32_t num_images,
                                          const Map& map);

// An image that a localizer was given, and the map that it is of.
struct LocalizedImage {
  Localization found;
  std::shared_ptr<const Map> map;
};
// As cairn_localize without a prior, and logged as by that.  Its localizers are in c_api.cc.
Result<LocalizedImage> LocalizeAlone(cairn_localizer* localizer, const cairn_image* image,
                                     const cairn_camera* camera);

// NULL: none.
Result<std::optional<PosePrior>> PriorOf(const cairn_prior* given);
cairn_prior PriorFrom(const PosePrior& prior);

Result<UncertainPose> UncertainPoseOf(const cairn_uncertain_pose* given);
cairn_uncertain_pose UncertainPoseFrom(const UncertainPose& pose);

// Callers built with an earlier release give the fields that it had.
Status CheckFix(const cairn_fix* fix);
Status CheckFix(const cairn_floor_fix* fix);
cairn_fix FixFrom(const Localization& found);
cairn_floor_fix FloorFixFrom(const VisualPose& found, Scope scope);

cairn_survey_image SurveyImageFrom(const std::string& name, const Pose& cam_from_world);

}  // namespace cairn
