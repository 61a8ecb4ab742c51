#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "tests/runtime/localize/poster_scene.h"

namespace cairn {

// A wall with a poster and a floor with another, so that an image determines how a robot moved; and a row of
// survey images that look along x, the way of a robot that is steered from one to the next:
//
//   r0   r1   r2   r3          |
//   -4  -3.6 -3.2 -2.8    ...  3 m     the floor's poster lies between -2 and 3
//
class PosterRoom {
 public:
  static constexpr double kFirstM = -4, kBetweenM = 0.4;
  static constexpr int kNumImages = 4;

  PosterRoom() {
    rows_.name = "room";
    rows_.writer = "cairn test";
    rows_.landmark_choice = "all";
    rows_.cameras = {scene_.camera};
    std::vector<build_vocabulary::ImageDescriptors> documents;
    for (int i = 0; i < kNumImages; ++i) {
      const MapImage& image = AddImage("r" + std::to_string(i), kFirstM + kBetweenM * i);
      documents.push_back(
          {image.image_id, rows_.descriptors.bottomRows(static_cast<Eigen::Index>(image.landmarks.size()))});
      rows_.appearance.push_back({.images = {i}, .is_kept = true});
      rows_.appearance.back().entropy = 0.5;
      if (i > 0) rows_.appearance[i - 1].links.push_back({i, 40});
    }
    NoProgress progress;
    rows_.vocabulary = *build_vocabulary::BuildVocabulary(documents, {}, {}, 0, 1, progress);
  }

  const MapRows& rows() const { return rows_; }
  // What a robot sees from there, looking along x but for `turn_deg` to the left.
  cv::Mat PictureAt(double x_m, double y_m = 0, double turn_deg = 0) const {
    return Render(PoseAt({x_m, y_m, kHeightM}, turn_deg));
  }

 private:
  static constexpr double kHeightM = 1.5, kWallM = 3;

  cv::Mat Render(const Pose& cam_from_world) const {
    cv::Mat image = RenderPoster(scene_, cam_from_world);
    std::vector<cv::Point2f> from, to;
    for (const auto& [u, v] : {std::pair(0.0, 0.0), {800.0, 0.0}, {800.0, 600.0}, {0.0, 600.0}}) {
      const Eigen::Vector3d x = cam_from_world * Eigen::Vector3d(3 - v / 120, 2 - u / 200, 0);
      const Eigen::Vector2d pixel = 280 * x.hnormalized() + Eigen::Vector2d(160, 120);
      from.emplace_back(u - 0.5, v - 0.5);
      to.emplace_back(pixel.x() - 0.5, pixel.y() - 0.5);
    }
    cv::warpPerspective(floor_, image, cv::getPerspectiveTransform(from, to), image.size(), cv::INTER_LINEAR,
                        cv::BORDER_TRANSPARENT);
    return image;
  }

  // Its features lie where their rays meet the floor or the wall.
  const MapImage& AddImage(const std::string& name, double x_m) {
    MapImage image{.image_id = static_cast<ImageId>(rows_.images.size() + 1),
                   .name = name,
                   .camera_id = scene_.camera.camera_id,
                   .cam_from_world = PoseAt({x_m, 0, kHeightM}, 0)};
    const Features features = *ExtractSift(Render(image.cam_from_world), {});
    const Pose world_from_cam = image.cam_from_world.Inverse();
    for (const Keypoint& keypoint : features.keypoints) {
      const auto ray = CameraFromImage(scene_.camera, {keypoint.x, keypoint.y});
      const Eigen::Vector3d direction = world_from_cam.rotation * ray->homogeneous();
      const double to_wall = (kWallM - x_m) / direction.x();
      const double to_floor = direction.z() < 0 ? kHeightM / -direction.z() : to_wall;
      image.landmarks.push_back(static_cast<LandmarkIdx>(rows_.landmarks.size()));
      rows_.landmarks.push_back(
          {.position = world_from_cam.translation + std::min(to_wall, to_floor) * direction,
           .covariance = 1e-6 * Eigen::Matrix3d::Identity(),
           .num_observations = 1});
    }
    const Eigen::Index before = rows_.descriptors.rows();
    rows_.descriptors.conservativeResize(before + features.descriptors.rows(), kSiftDescriptorDim);
    rows_.descriptors.bottomRows(features.descriptors.rows()) = features.descriptors;
    rows_.images.push_back(std::move(image));
    return rows_.images.back();
  }

  PosterScene scene_ = MakePosterScene(1);
  cv::Mat floor_ = MakePosterScene(2).poster;
  MapRows rows_;
};

}  // namespace cairn
