#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "core/base/pooled.h"
#include "core/base/random.h"
#include "core/capture/capture.h"
#include "core/colmap/colmap_model.h"
#include "stages/reconstruct/by_colmap/mapper.h"

namespace cairn::reconstruct {

// A cloud of points seen by cameras that walk past it, with exact matches: what the mapper gets from
// matches.db of a survey whose poses are known.
struct SyntheticSurvey {
  MapperInput input;
  Capture capture;                    // the images' names; no files, no poses
  std::vector<Pose> cams_from_world;  // per image, metres, z up
  std::vector<Eigen::Vector3d> points;
  Camera camera;
};

inline constexpr double kKeypointNoisePx = 0.3;

// `num_images` cameras on a quarter circle about a cloud of 500 points of 6 x 6 x 3 m.  `first_id` numbers
// the images, whose names are `prefix`NN.jpg.
inline SyntheticSurvey MakeSyntheticSurvey(int num_images, uint64_t seed, const std::string& prefix = "image",
                                           ImageId first_id = 1) {
  SyntheticSurvey survey;
  Random random(seed);
  survey.camera.model = CameraModel::kSimplePinhole;
  survey.camera.width = 640;
  survey.camera.height = 480;
  survey.camera.params = {500, 320, 240};
  Camera guess = GuessCamera(1, 640, 480);  // 768 px: 54 % off
  survey.input.cameras.emplace(1, guess);
  survey.capture.cameras = survey.input.cameras;
  for (int i = 0; i < 500; ++i)
    survey.points.emplace_back(random.Uniform(-3, 3), random.Uniform(-3, 3), random.Uniform(0, 3));
  std::vector<std::vector<int>> point_of_keypoint;
  for (int i = 0; i < num_images; ++i) {
    const double angle = 1.6 * i / num_images;
    const Eigen::Vector3d centre((9 + 0.5 * (i % 3)) * std::cos(angle), 9 * std::sin(angle),
                                 1.5 + 0.2 * (i % 2));
    const Eigen::Vector3d forward = Eigen::Vector3d(-centre.x(), -centre.y(), 0).normalized();
    Eigen::Matrix3d rotation;
    rotation.row(2) = forward;
    rotation.row(1) = -Eigen::Vector3d::UnitZ();
    rotation.row(0) = Eigen::Vector3d(rotation.row(1)).cross(forward);
    Pose pose{Eigen::Quaterniond(rotation), -(rotation * centre)};
    PooledVector<Keypoint> keypoints;
    std::vector<int> shown;
    for (size_t p = 0; p < survey.points.size(); ++p) {
      const auto pixel = ImageFromCamera(survey.camera, pose * survey.points[p]);
      const bool is_seen = pixel && pixel->x() > 0 && pixel->x() < 640 && pixel->y() > 0 && pixel->y() < 480;
      if (!is_seen || random.Uniform() < 0.3) continue;
      keypoints.push_back({.x = static_cast<float>(pixel->x() + random.Normal(0, kKeypointNoisePx)),
                           .y = static_cast<float>(pixel->y() + random.Normal(0, kKeypointNoisePx)),
                           .scale = 2,
                           .orientation = 0});
      shown.push_back(static_cast<int>(p));
    }
    const std::string name = fmt::format("{}{:02}.jpg", prefix, i);
    survey.input.images.push_back({first_id + static_cast<ImageId>(i), name, 1});
    survey.input.keypoints.push_back(keypoints);
    survey.capture.images.push_back({name, 1, std::nullopt});
    survey.cams_from_world.push_back(pose);
    point_of_keypoint.push_back(shown);
  }
  for (int i = 0; i < num_images; ++i) {
    for (int j = i + 1; j < num_images && j <= i + 5; ++j) {
      TwoViewGeometry geometry{.image_id1 = first_id + static_cast<ImageId>(i),
                               .image_id2 = first_id + static_cast<ImageId>(j),
                               .config = TwoViewConfig::kUncalibrated};
      for (size_t a = 0, b = 0; a < point_of_keypoint[i].size() && b < point_of_keypoint[j].size();) {
        const int point1 = point_of_keypoint[i][a], point2 = point_of_keypoint[j][b];
        if (point1 == point2)
          geometry.inliers.push_back({static_cast<KeypointIdx>(a), static_cast<KeypointIdx>(b)});
        a += point1 <= point2 ? 1 : 0;
        b += point2 <= point1 ? 1 : 0;
      }
      survey.input.geometries.push_back(geometry);
    }
  }
  return survey;
}

// Largest distance of a centre from the true one after the best similarity, metres.
inline double LargestErrorM(const ColmapModel& model, const SyntheticSurvey& survey) {
  Eigen::Matrix3Xd found(3, model.images.size()), truth(3, model.images.size());
  for (size_t i = 0; i < model.images.size(); ++i) {
    found.col(i) = model.images[i].cam_from_world.Center();
    for (size_t k = 0; k < survey.input.images.size(); ++k) {
      if (survey.input.images[k].name == model.images[i].name)
        truth.col(i) = survey.cams_from_world[k].Center();
    }
  }
  const Eigen::Matrix4d fit = Eigen::umeyama(found, truth, true);
  return (((fit.topLeftCorner<3, 3>() * found).colwise() + fit.topRightCorner<3, 1>()) - truth)
      .colwise()
      .norm()
      .maxCoeff();
}

// Adds another survey's images to the first one's, without a match between them.
inline void AppendSurvey(const SyntheticSurvey& other, SyntheticSurvey* survey) {
  const auto append = [](const auto& from, auto* to) { to->insert(to->end(), from.begin(), from.end()); };
  append(other.input.images, &survey->input.images);
  append(other.input.keypoints, &survey->input.keypoints);
  append(other.input.geometries, &survey->input.geometries);
  append(other.capture.images, &survey->capture.images);
  append(other.cams_from_world, &survey->cams_from_world);
  append(other.points, &survey->points);
}

}  // namespace cairn::reconstruct
