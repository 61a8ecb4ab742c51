#pragma once

#include <memory>
#include <string>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/random.h"
#include "core/blocks/map_rows.h"
#include "core/camera/pixel_ray.h"
#include "core/features/sift.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/map/map.h"
#include "stages/build_vocabulary/build_vocabulary.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {

// A wall (the plane x = 3 m) with a poster of random blobs, 4 m wide and 3 m high: real pixels with
// known geometry.
struct PosterScene {
  cv::Mat poster;  // 1 px = 5 mm
  Camera camera;
};
inline constexpr double kPosterPixelM = 0.005;

inline PosterScene MakePosterScene(uint64_t seed) {
  PosterScene scene;
  Random random(seed);
  scene.poster = cv::Mat(600, 800, CV_8UC1, cv::Scalar(120));
  for (int i = 0; i < 900; ++i) {
    const int radius = static_cast<int>(random.UniformInt(3, 18));
    cv::rectangle(
        scene.poster,
        cv::Rect(static_cast<int>(random.UniformInt(0, 799)), static_cast<int>(random.UniformInt(0, 599)),
                 radius, static_cast<int>(random.UniformInt(3, 18))),
        cv::Scalar(static_cast<double>(random.UniformInt(0, 255))), cv::FILLED);
  }
  cv::GaussianBlur(scene.poster, scene.poster, {}, 1);
  scene.camera.model = CameraModel::kSimplePinhole;
  scene.camera.width = 320;
  scene.camera.height = 240;
  scene.camera.params = {280, 160, 120};
  return scene;
}

// The wall's point at poster coordinates (px of the first pixel's corner).
inline Eigen::Vector3d PosterPoint(double u, double v) {
  return {3, 2 - u * kPosterPixelM, 3 - v * kPosterPixelM};
}

inline cv::Mat RenderPoster(const PosterScene& scene, const Pose& cam_from_world) {
  std::vector<cv::Point2f> from, to;
  for (const auto& [u, v] : {std::pair(0.0, 0.0), {800.0, 0.0}, {800.0, 600.0}, {0.0, 600.0}}) {
    // Relative to the first pixel's centre, as OpenCV counts.
    const Eigen::Vector3d x = cam_from_world * PosterPoint(u, v);
    const Eigen::Vector2d pixel = 280 * x.hnormalized() + Eigen::Vector2d(160, 120);
    from.emplace_back(u - 0.5, v - 0.5);
    to.emplace_back(pixel.x() - 0.5, pixel.y() - 0.5);
  }
  cv::Mat image;
  cv::warpPerspective(scene.poster, image, cv::getPerspectiveTransform(from, to), {320, 240}, cv::INTER_AREA,
                      cv::BORDER_CONSTANT, cv::Scalar(60));
  return image;
}

// A map whose landmarks are the features of a few views, put on the wall by their rays; each is seen in its
// one image.
inline MapRows MakePosterMap(const PosterScene& scene) {
  MapRows rows;
  rows.name = "poster";
  rows.writer = "cairn test";
  rows.cameras = {scene.camera};
  rows.landmark_choice = "all";
  std::vector<build_vocabulary::ImageDescriptors> documents;
  std::vector<Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim>> descriptors;
  for (int i = 0; i < 3; ++i) {
    MapImage image{.image_id = static_cast<ImageId>(i + 1),
                   .name = "view" + std::to_string(i),
                   .camera_id = 1,
                   .cam_from_world = PoseAt({0, 1.0 * (i - 1), 1.5}, 0)};
    const Features features = *ExtractSift(RenderPoster(scene, image.cam_from_world), {});
    for (size_t k = 0; k < features.keypoints.size(); ++k) {
      const auto ray = CameraFromImage(scene.camera, {features.keypoints[k].x, features.keypoints[k].y});
      const Eigen::Vector3d direction = image.cam_from_world.rotation.conjugate() * ray->homogeneous();
      const Eigen::Vector3d center = image.cam_from_world.Center();
      image.landmarks.push_back(static_cast<LandmarkIdx>(rows.landmarks.size()));
      const Eigen::Vector3d position = center + direction * ((3 - center.x()) / direction.x());
      const double depth = DepthOfScale(scene.camera, image.cam_from_world * position);
      rows.landmarks.push_back({.position = position,
                                .covariance = 1e-6 * Eigen::Matrix3d::Identity(),
                                .scale_m = features.keypoints[k].scale * depth / scene.camera.MeanFocal(),
                                .num_observations = 1});
      descriptors.push_back(features.descriptors.row(static_cast<Eigen::Index>(k)));
    }
    documents.push_back({image.image_id, features.descriptors});
    rows.images.push_back(std::move(image));
  }
  rows.descriptors.resize(static_cast<Eigen::Index>(descriptors.size()), kSiftDescriptorDim);
  for (size_t i = 0; i < descriptors.size(); ++i) rows.descriptors.row(i) = descriptors[i];
  NoProgress progress;
  rows.vocabulary = *build_vocabulary::BuildVocabulary(documents, {}, {}, 0, 1, progress);
  return rows;
}

// What finds a camera before the poster: a place on the wall is up to three landmarks, one per view.
inline LocalizerOptions PosterOptions() {
  LocalizerOptions options;
  options.match.max_ratio = 0.95;
  return options;
}

inline const PosterScene& Poster() {
  static const PosterScene scene = MakePosterScene(1);
  return scene;
}

inline const std::shared_ptr<const Map>& PosterMap() {
  static const std::shared_ptr<const Map> map = *Map::FromRows(MakePosterMap(Poster()));
  return map;
}

// Between the views, so that most of a feature's copies in the map are one place seen from two sides.
inline Pose PosterQueryPose() { return PoseAt({0.4, 0.1, 1.6}, 4); }

}  // namespace cairn
