#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tests/runtime/localize/poster_scene.h"

namespace cairn {

// Two wings that look alike but for the third place of each, and a hall; a place has one survey image and
// shows one poster, which stands below it:
//
//   a0 - a1 - a2 - a3
//    1    2    3    4 \ h0 - h1 - h2     h0 and h2 are linked, too, but by few matches
//    1    2    5    4 /  6    7    8
//   b0 - b1 - b2 - b3
//
// A robot drives along wing b into the hall: a picture at each place, 10 cm to the left of wing a's.
class PosterWings {
 public:
  PosterWings() {
    rows_.name = "wings";
    rows_.writer = "cairn test";
    rows_.landmark_choice = "all";
    const std::vector<std::pair<std::string, int>> places = {{"a0", 1}, {"a1", 2}, {"a2", 3}, {"a3", 4},
                                                             {"b0", 1}, {"b1", 2}, {"b2", 5}, {"b3", 4},
                                                             {"h0", 6}, {"h1", 7}, {"h2", 8}};
    for (const auto& [name, poster] : places) AddPlace(name, poster);
    NoProgress progress;
    rows_.vocabulary = *build_vocabulary::BuildVocabulary(documents_, {}, {}, 0, 1, progress);
    for (const int wing : {0, 4}) {
      for (int i = 0; i < 3; ++i) Link(wing + i, wing + i + 1, 40);
      Link(wing + 3, 8, 40);
    }
    Link(8, 9, 40);
    Link(8, 10, 10);
    Link(9, 10, 40);
    // Wing a seems to be a little less ambiguous: the robot follows its way first.
    const std::vector<double> entropies = {0.5, 0.5, 0, 0.5, 0.75, 0.75, 0, 0.75, 0, 0, 0};
    for (size_t i = 0; i < entropies.size(); ++i) rows_.appearance[i].entropy = entropies[i];
  }

  const MapRows& rows() const { return rows_; }
  const std::vector<cv::Mat>& pictures() const { return pictures_; }

 private:
  void AddPlace(const std::string& name, int poster) {
    const PosterScene scene = MakePosterScene(static_cast<uint64_t>(poster));
    rows_.cameras = {scene.camera};
    // In wing b the survey stood 30 cm to the left: one wing is not the other pixel for pixel.
    const Eigen::Vector3d place(0, name[0] == 'b' ? 0.3 : 0, 1.5),
        offset(0, 10.0 * static_cast<double>(rows_.images.size()), 0);
    MapImage image{.image_id = static_cast<ImageId>(rows_.images.size() + 1),
                   .name = name,
                   .camera_id = scene.camera.camera_id,
                   .cam_from_world = PoseAt(place + offset, 0)};
    const Features features = *ExtractSift(RenderPoster(scene, PoseAt(place, 0)), {});
    const auto first = static_cast<Eigen::Index>(rows_.landmarks.size());
    for (const Keypoint& keypoint : features.keypoints) {
      const auto ray = CameraFromImage(scene.camera, {keypoint.x, keypoint.y});
      image.landmarks.push_back(static_cast<LandmarkIdx>(rows_.landmarks.size()));
      rows_.landmarks.push_back(
          {.position = image.cam_from_world.Inverse() * Eigen::Vector3d(3 * ray->homogeneous()),
           .covariance = 1e-6 * Eigen::Matrix3d::Identity(),
           .num_observations = 1});
    }
    rows_.descriptors.conservativeResize(first + features.descriptors.rows(), kSiftDescriptorDim);
    rows_.descriptors.bottomRows(features.descriptors.rows()) = features.descriptors;
    documents_.push_back({image.image_id, features.descriptors});
    rows_.appearance.push_back({.images = {static_cast<int32_t>(rows_.images.size())}, .is_kept = true});
    rows_.images.push_back(std::move(image));
    if (name[0] != 'a') pictures_.push_back(RenderPoster(scene, PoseAt({0, 0.1, 1.5}, 1)));
  }

  void Link(int node, int other, int num_inliers) {
    rows_.appearance[node].links.push_back({other, num_inliers});
  }

  MapRows rows_;
  std::vector<build_vocabulary::ImageDescriptors> documents_;
  std::vector<cv::Mat> pictures_;
};

inline const PosterWings& Wings() {
  static const PosterWings wings;
  return wings;
}

}  // namespace cairn
