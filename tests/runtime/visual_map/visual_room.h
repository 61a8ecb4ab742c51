#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/random.h"
#include "core/blocks/map_rows.h"
#include "core/camera/camera.h"
#include "core/geometry/floor_pose.h"
#include "core/world/feature_class.h"
#include "runtime/visual_map/visual_map.h"

namespace cairn {

// How much a survey's cameras pitch, and differ in height, standard deviations.
struct CarriedSurvey {
  double tilt_rad = 0;
  double height_m = 0;
};

// A room of 5 x 4 m with points on its walls, surveyed in its middle on 9 x 7 places 25 cm apart with four
// headings, as classes and as the rows of a map.
struct VisualRoom {
  static constexpr double kFocalPx = 320;
  static constexpr int kWidthPx = 640, kHeightPx = 480;
  static constexpr int kNumColumns = 9, kNumRows = 7;
  static constexpr double kSpacingM = 0.25;

  std::vector<Eigen::Vector3d> points;
  Classes classes;
  MapRows rows;

  explicit VisualRoom(int num_points = 160, double noise_px = 0,
                      const std::vector<Eigen::Vector3d>& more_points = {},
                      const CarriedSurvey& carried = {}) {
    Random random(5);
    for (int i = 0; i < num_points; ++i) {
      const double along = random.Uniform(), height = random.Uniform(0, 2.5);
      const int wall = static_cast<int>(random.UniformInt(0, 3));
      const double x = wall % 2 == 0 ? 5 * along : (wall == 1 ? 0.0 : 5.0);
      const double y = wall % 2 == 1 ? 4 * along : (wall == 0 ? 0.0 : 4.0);
      points.emplace_back(x, y, height);
    }
    points.insert(points.end(), more_points.begin(), more_points.end());
    AddSurvey(noise_px, carried);
  }

  static Eigen::Vector2d Place(int column, int row) {
    return {1.5 + kSpacingM * column, 1.25 + kSpacingM * row};
  }

  // x right, y down, z forward; pitched up.
  static Pose PoseAt(const Eigen::Vector2d& place, double heading_rad, double up_rad = 0,
                     double height_m = 1) {
    const double c = std::cos(heading_rad), s = std::sin(heading_rad);
    Eigen::Matrix3d level;
    level << s, -c, 0, 0, 0, -1, c, s, 0;
    Pose pose;
    pose.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(-up_rad, Eigen::Vector3d::UnitX()) * level);
    pose.translation = -(pose.rotation * Eigen::Vector3d(place.x(), place.y(), height_m));
    return pose;
  }

  // What a camera sees: point and keypoint.
  std::vector<std::pair<int, Keypoint>> See(const Pose& cam_from_world) const {
    std::vector<std::pair<int, Keypoint>> seen;
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d point = cam_from_world * points[i];
      if (point.z() < 0.2) continue;
      const Keypoint keypoint{static_cast<float>(kFocalPx * point.x() / point.z() + kWidthPx / 2),
                              static_cast<float>(kFocalPx * point.y() / point.z() + kHeightPx / 2),
                              static_cast<float>(12 / point.norm()), 0};
      if (keypoint.x >= 0 && keypoint.x <= kWidthPx && keypoint.y >= 0 && keypoint.y <= kHeightPx)
        seen.emplace_back(static_cast<int>(i), keypoint);
    }
    return seen;
  }

  std::vector<SeenLandmark> SeenLandmarks(const Pose& cam_from_world) const {
    std::vector<SeenLandmark> matches;
    for (const auto& [point, keypoint] : See(cam_from_world))
      matches.push_back({point, {keypoint.x, keypoint.y, std::log2(keypoint.scale)}});
    return matches;
  }

 private:
  void AddSurvey(double noise_px, const CarriedSurvey& carried) {
    Random random(6), heights(7);
    Camera camera;
    camera.width = kWidthPx;
    camera.height = kHeightPx;
    camera.params = {kFocalPx, kWidthPx / 2, kHeightPx / 2};
    rows.cameras = classes.cameras = {camera};
    classes.classes.resize(points.size());
    for (size_t i = 0; i < points.size(); ++i) classes.classes[i].class_id = static_cast<ClassId>(i);
    for (int row = 0; row < kNumRows; ++row) {
      for (int column = 0; column < kNumColumns; ++column) {
        const auto station = static_cast<StationIdx>(rows.stations.size());
        rows.stations.push_back({.position = Place(column, row)});
        for (int heading = 0; heading < 4; ++heading) {
          MapImage image;
          image.image_id = static_cast<ImageId>(rows.images.size() + 1);
          image.name = "image" + std::to_string(image.image_id);
          image.camera_id = camera.camera_id;
          image.station = station;
          image.cam_from_world =
              PoseAt(Place(column, row), heading * std::numbers::pi / 2, random.Normal(0, carried.tilt_rad),
                     heights.Normal(1, carried.height_m));
          for (auto [point, keypoint] : See(image.cam_from_world)) {
            keypoint.x += static_cast<float>(random.Normal(0, noise_px));
            keypoint.y += static_cast<float>(random.Normal(0, noise_px));
            classes.classes[point].observations.push_back({image.image_id, 0, keypoint});
            image.landmarks.push_back(point);
          }
          rows.images.push_back(image);
        }
      }
    }
    rows.descriptors.resize(static_cast<Eigen::Index>(points.size()), kSiftDescriptorDim);
    for (size_t i = 0; i < points.size(); ++i) {
      rows.landmarks.push_back({.class_id = classes.classes[i].class_id, .position = points[i]});
      // As long as RootSIFT's, and mostly apart.
      Eigen::Matrix<double, 1, kSiftDescriptorDim> values;
      for (double& value : values) value = std::pow(random.Uniform(), 6);
      values *= 512 / values.norm();
      rows.descriptors.row(static_cast<Eigen::Index>(i)) = values.cwiseMin(255.0).cast<uint8_t>();
    }
  }
};

}  // namespace cairn
