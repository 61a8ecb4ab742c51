#include <utility>

#include "stages/group_classes/adjust/adjust_survey.h"

namespace cairn::group_classes {

OptionTable DescribeOptions(AdjustSurveyOptions* o) {
  OptionTable table = {{.name = "refine_cameras",
                        .value = &o->refine_cameras,
                        .help = "find out which parameters of the cameras differ from what is stated"}};
  for (Option& option : DescribeOptions(&o->camera_prior)) table.push_back(std::move(option));
  const OptionTable others = {
      {.name = "refine_camera_offset",
       .value = &o->refine_camera_offset,
       .help = "find one rigid offset between all stated poses and their cameras"},
      {.name = "offset_sigma_m",
       .value = &o->offset_sigma_m,
       .help = "standard deviation of that offset, metres",
       .min = 1e-6},
      {.name = "offset_sigma_deg",
       .value = &o->offset_sigma_deg,
       .help = "standard deviation of that offset, degrees",
       .min = 1e-6},
      {.name = "num_keypoints_adjusted",
       .value = &o->num_keypoints_adjusted,
       .help = "keypoints of an image that decide on poses and cameras",
       .min = 10},
      {.name = "num_images_learnt",
       .value = &o->num_images_learnt,
       .help = "images from which the noise of poses and the cameras are learnt",
       .min = 10,
       .max = 1000},
      {.name = "num_rounds",
       .value = &o->num_rounds,
       .help = "most rounds in which the noise of the stated poses is learnt",
       .min = 1,
       .max = 100},
      {.name = "max_num_iterations",
       .value = &o->max_num_iterations,
       .help = "most iterations of a round's solver",
       .min = 1},
      {.name = "num_images_at_once",
       .value = &o->num_images_at_once,
       .help = "poses of a survey of more images are straightened in parts before all are adjusted together",
       .min = 10},
      {.name = "num_images_together",
       .value = &o->num_images_together,
       .help = "most images whose poses are adjusted together: a larger survey is adjusted block by block",
       .min = 10},
  };
  table.insert(table.end(), others.begin(), others.end());
  AddCondition({"refine_cameras", {"true"}},
               {"focal_sigma_ratio", "principal_point_sigma_ratio", "distortion_sigma", "calibrated_ratio"},
               &table);
  AddCondition({"refine_camera_offset", {"true"}}, {"offset_sigma_m", "offset_sigma_deg"}, &table);
  return table;
}

}  // namespace cairn::group_classes
