#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "core/base/random.h"
#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "stages/group_classes/tracks/matched_features.h"

namespace cairn::group_classes {

// A row of cameras that see random points, with exact matches between neighbours; the capture states poses
// with noise.
struct Survey {
  MatchedFeatures matched;
  Capture capture;
  std::vector<Eigen::Vector3d> points;
  std::vector<Pose> true_poses;
  std::vector<std::map<int, uint32_t>> keypoint_of_point;  // per image
};

struct SurveyNoise {
  double pixel = 0.3;
  double pose_m = 0;
  double pose_deg = 0;
  Pose offset;                      // true camera_from_given
  double focal_ratio = 1;           // true over stated
  double walk_m = 0, walk_deg = 0;  // drift from one image to the next
  double k1 = 0;                    // true distortion, of a camera that is stated without
};

inline Survey MakeSurvey(const SurveyNoise& noise) {
  constexpr int kImages = 24, kPoints = 400;
  Survey survey;
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 500, 320, 240};
  survey.matched.cameras.emplace(1, camera);
  survey.capture.cameras.emplace(1, camera);
  Camera true_camera = camera;
  true_camera.params[0] *= noise.focal_ratio;
  true_camera.params[1] *= noise.focal_ratio;
  if (noise.k1 != 0) {
    true_camera.model = CameraModel::kSimpleRadial;
    true_camera.params = {true_camera.params[0], 320, 240, noise.k1};
  }
  Random random(11), drift_random(12);
  Pose drift;  // world_from_drifted world
  std::vector<Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim>> looks;
  for (int p = 0; p < kPoints; ++p) {
    survey.points.emplace_back(random.Uniform(-3, 3), random.Uniform(-1.2, 1.2), random.Uniform(2, 4));
    Eigen::Matrix<double, 1, kSiftDescriptorDim> d;
    for (int k = 0; k < kSiftDescriptorDim; ++k) d[k] = std::pow(random.Uniform(), 6);
    looks.push_back((d * 512 / d.norm()).array().round().cwiseMin(255.0).cast<uint8_t>());
  }
  std::vector<std::map<int, uint32_t>>& keypoint_of_point = survey.keypoint_of_point;
  keypoint_of_point.resize(kImages);
  for (int i = 0; i < kImages; ++i) {
    Pose given;
    const double turn = i * 0.4;
    given.rotation = Eigen::AngleAxisd(0.2 * std::sin(turn), Eigen::Vector3d(0.3, 1, 0.2).normalized()) *
                     Eigen::AngleAxisd(0.4 * std::cos(0.7 * turn), Eigen::Vector3d::UnitZ());
    given.translation = -(given.rotation * Eigen::Vector3d(-1.5 + 3.0 * i / kImages, 0.2 * std::sin(turn),
                                                           0.3 * std::cos(turn)));
    const Pose true_pose = noise.offset * given;
    survey.true_poses.push_back(true_pose);
    Pose stated = given;
    stated.translation +=
        noise.pose_m * Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1));
    stated.rotation = (Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(noise.pose_deg) * random.Normal(0, 1),
                                                            Eigen::Vector3d::Unit(i % 3))) *
                       stated.rotation)
                          .normalized();
    if (i > 0 && (noise.walk_m > 0 || noise.walk_deg > 0)) {
      const auto step = [&](double sigma) {
        return Eigen::Vector3d(drift_random.Normal(0, sigma), drift_random.Normal(0, sigma),
                               drift_random.Normal(0, sigma));
      };
      const Eigen::Vector3d turn_by = step(RadFromDeg(noise.walk_deg));
      const Pose error{Eigen::Quaterniond(Eigen::AngleAxisd(turn_by.norm(), turn_by.normalized())),
                       step(noise.walk_m)};
      drift = drift * (given.Inverse() * error * given);
    }
    stated = stated * drift;
    const std::string name = fmt::format("image{:02d}.png", i);
    survey.capture.images.push_back({name, 1, stated});
    survey.matched.images.push_back({static_cast<ImageId>(i + 1), name, 1});
    Features features;
    std::vector<int> seen;
    for (int p = 0; p < kPoints; ++p) {
      const auto pixel = ImageFromCamera(true_camera, true_pose * survey.points[p]);
      if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > 640 || pixel->y() > 480) continue;
      keypoint_of_point[i][p] = static_cast<uint32_t>(features.keypoints.size());
      features.keypoints.push_back({static_cast<float>(pixel->x() + random.Normal(0, noise.pixel)),
                                    static_cast<float>(pixel->y() + random.Normal(0, noise.pixel)), 2, 0});
      seen.push_back(p);
    }
    features.descriptors.resize(static_cast<Eigen::Index>(seen.size()), kSiftDescriptorDim);
    for (size_t k = 0; k < seen.size(); ++k)
      features.descriptors.row(static_cast<Eigen::Index>(k)) = looks[seen[k]];
    survey.matched.features.push_back(std::move(features));
  }
  for (int i = 0; i < kImages; ++i) {
    for (int j = i + 1; j < std::min(kImages, i + 6); ++j) {
      TwoViewGeometry geometry;
      geometry.image_id1 = static_cast<ImageId>(i + 1);
      geometry.image_id2 = static_cast<ImageId>(j + 1);
      for (const auto& [p, k] : keypoint_of_point[i]) {
        if (const auto other = keypoint_of_point[j].find(p); other != keypoint_of_point[j].end()) {
          geometry.inliers.push_back({k, other->second});
        }
      }
      survey.matched.geometries.push_back(geometry);
    }
  }
  return survey;
}

// Every other image is of session "b", where what lies in the middle is gone: it has keypoints there, but
// they match nothing.
inline Survey SurveyOfTwoSessions(std::set<int>* gone) {
  Survey survey = MakeSurvey({});
  for (size_t i = 0; i < survey.matched.images.size(); ++i) {
    const std::string name = fmt::format("{}/{}", i % 2 == 0 ? "a" : "b", survey.matched.images[i].name);
    survey.matched.images[i].name = survey.capture.images[i].name = name;
  }
  for (size_t p = 0; p < survey.points.size(); ++p) {
    if (survey.points[p].head<2>().norm() < 0.8) gone->insert(static_cast<int>(p));
  }
  for (TwoViewGeometry& geometry : survey.matched.geometries) {
    std::erase_if(geometry.inliers, [&](const Match& match) {
      return std::any_of(gone->begin(), gone->end(), [&](int p) {
        const auto is_of = [&](ImageId image_id, uint32_t keypoint) {
          const auto found = survey.keypoint_of_point[image_id - 1].find(p);
          return image_id % 2 == 0 && found != survey.keypoint_of_point[image_id - 1].end() &&
                 found->second == keypoint;
        };
        return is_of(geometry.image_id1, match.idx1) || is_of(geometry.image_id2, match.idx2);
      });
    });
  }
  std::sort(survey.capture.images.begin(), survey.capture.images.end(),
            [](const CaptureImage& a, const CaptureImage& b) { return a.name < b.name; });
  return survey;
}

// The survey's database.
inline void WriteMatches(const MatchedFeatures& matched, const std::string& path) {
  SQLite::Database database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec(kColmapSchema);
  SQLite::Transaction transaction(database);
  for (const auto& [camera_id, camera] : matched.cameras) WriteDatabaseCamera(database, camera);
  for (size_t i = 0; i < matched.images.size(); ++i) {
    WriteDatabaseImage(database, matched.images[i]);
    WriteDatabaseFeatures(database, matched.images[i].image_id, matched.features[i]);
  }
  for (const TwoViewGeometry& geometry : matched.geometries) WriteDatabaseTwoViewGeometry(database, geometry);
  transaction.commit();
}

}  // namespace cairn::group_classes
