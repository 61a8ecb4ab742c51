#pragma once

#include <cstddef>
#include <optional>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/pose.h"
#include "core/world/feature_class.h"

namespace cairn {

// Standard deviation of a small keypoint's position, px, and its growth with the keypoint's scale.
struct KeypointErrors {
  double sigma_px = 0.5;         // REQUIRES: > 0
  double sigma_per_scale = 0.2;  // REQUIRES: >= 0
};

// What seeing a class from any pose tells about that pose.
class LandmarkSights {
 public:
  // `classes` must outlive it.
  LandmarkSights(const Classes& classes, const KeypointErrors& errors);

  // InformationRoot (pose_information.h) of the i-th class: the keypoint has the scale in which a camera of
  // this focal length, px, would see it from there; its error and the class's reprojection error add as
  // squares.
  std::optional<Eigen::Matrix<double, 2, 6>> Root(size_t i, const Pose& cam_from_world, double focal,
                                                  double probability) const;
  // Mean focal length of a survey image's camera, px; 1 where it has none.
  double FocalOf(ImageId image_id) const { return focal_of_image_.at(image_id); }

 private:
  const Classes& classes_;
  KeypointErrors errors_;
  std::unordered_map<ImageId, double> focal_of_image_;
  std::vector<double> size_rad_m_;  // per class: angle of its keypoints times distance
};

}  // namespace cairn
