#pragma once

#include <vector>

#include "stages/emit_map/model_landmarks.h"
#include "tests/runtime/localize/poster_scene.h"

namespace cairn {

// A frame of the drive, and how the robot drove since the one before.
struct DriveFrame {
  Pose cam_from_world;
  double ahead_m = 0;
  cv::Mat picture;
};

// A robot drives towards the poster, is carried away without its odometry noticing, and stands there:
//
//   y ^                                      |  poster
//     |        5 6   (10 degrees to the left)|
//     |  0 1 2 3 4                           |
//     +------------------------------------> x
//       -0.9      ...  10 cm a frame         3
//
// The map is surveyed on a lattice of 5 x 7 places, 25 cm apart, looking along x.  It has a visual map and
// two regions, the poster's left and right half, either to be seen from all places.
class PosterDrive {
 public:
  static constexpr int kCarried = 5;  // the frame before which it is carried away

  PosterDrive() {
    SurveyPoster();
    for (int i = 0; i < kCarried; ++i) Drive(PoseAt({-0.9 + 0.1 * i, -0.4, 1.5}, 0), i > 0 ? 0.1 : 0);
    for (int i = 0; i < 2; ++i) Drive(PoseAt({-0.3, 0.5, 1.5}, 10), 0);
  }

  const MapRows& rows() const { return rows_; }
  const std::vector<DriveFrame>& frames() const { return frames_; }

 private:
  void Drive(const Pose& pose, double ahead_m) {
    frames_.push_back({.cam_from_world = pose, .ahead_m = ahead_m, .picture = RenderPoster(scene_, pose)});
  }

  // Landmarks are the features of one view of the whole poster; where they are seen from elsewhere is
  // computed.
  void SurveyPoster() {
    rows_.name = "drive";
    rows_.writer = "cairn test";
    rows_.cameras = {scene_.camera};
    Classes classes{.cameras = {scene_.camera}};
    rows_.regions.resize(2);
    const Pose view = PoseAt({-1, 0, 1.5}, 0);
    const double view_depth = 4;
    const Features features = *ExtractSift(RenderPoster(scene_, view), {});
    rows_.descriptors = features.descriptors;
    for (const Keypoint& keypoint : features.keypoints) {
      const auto landmark = static_cast<LandmarkIdx>(rows_.landmarks.size());
      const auto ray = CameraFromImage(scene_.camera, {keypoint.x, keypoint.y});
      const Eigen::Vector3d position = view.Inverse() * Eigen::Vector3d(view_depth * ray->homogeneous());
      rows_.landmarks.push_back({.class_id = static_cast<ClassId>(landmark),
                                 .position = position,
                                 .covariance = 1e-6 * Eigen::Matrix3d::Identity(),
                                 .num_observations = 1});
      classes.classes.push_back({.class_id = rows_.landmarks.back().class_id});
      rows_.regions[position.y() > 0 ? 0 : 1].landmarks.push_back(landmark);
    }
    for (int row = -3; row <= 3; ++row) {
      for (int column = 0; column < 5; ++column) {
        const Eigen::Vector3d place(-1 + 0.25 * column, 0.25 * row, 1.5);
        const auto station = static_cast<StationIdx>(rows_.stations.size());
        rows_.stations.push_back({.position = place.head<2>(), .heading_deg = 0});
        for (MapRegion& region : rows_.regions) region.stations.push_back(station);
        MapImage image{.image_id = static_cast<ImageId>(station + 1),
                       .name = "survey" + std::to_string(station),
                       .camera_id = scene_.camera.camera_id,
                       .cam_from_world = PoseAt(place, 0),
                       .station = station};
        for (size_t i = 0; i < rows_.landmarks.size(); ++i) {
          const Eigen::Vector3d point = image.cam_from_world * rows_.landmarks[i].position;
          const auto pixel = ImageFromCamera(scene_.camera, point);
          if (!pixel || !(pixel->x() > 0 && pixel->y() > 0 && pixel->x() < 320 && pixel->y() < 240)) continue;
          Keypoint seen = features.keypoints[i];
          seen.x = static_cast<float>(pixel->x());
          seen.y = static_cast<float>(pixel->y());
          seen.scale = static_cast<float>(seen.scale * view_depth / point.z());
          classes.classes[i].observations.push_back({image.image_id, 0, seen});
          image.landmarks.push_back(static_cast<LandmarkIdx>(i));
        }
        rows_.images.push_back(std::move(image));
      }
    }
    rows_.visual_map = *emit_map::ModelLandmarks(classes, rows_, {}, 1);
  }

  PosterScene scene_ = MakePosterScene(1);
  MapRows rows_;
  std::vector<DriveFrame> frames_;
};

}  // namespace cairn
