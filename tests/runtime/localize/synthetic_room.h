#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/random.h"
#include "core/blocks/map_rows.h"
#include "runtime/map/map.h"
#include "stages/build_vocabulary/build_vocabulary.h"

namespace cairn {

// A room of 10 m x 8 m x 3 m (world z up) with random landmarks on its four walls, surveyed from a grid of
// places with eight headings each.  Everything is known: landmarks, poses, noise.
struct SyntheticRoom {
  std::vector<Eigen::Vector3d> points;
  DescriptorMatrix descriptors;
  Camera camera;
  MapRows rows;  // landmark positions are the true ones
};

inline Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim> RandomDescriptor(Random& random) {
  Eigen::Matrix<double, 1, kSiftDescriptorDim> direction;
  for (int i = 0; i < kSiftDescriptorDim; ++i) direction[i] = std::pow(random.Uniform(), 3);
  direction *= 512 / direction.norm();
  return direction.array().min(255).round().cast<uint8_t>();
}

// The same feature seen again: every entry off by a few units.
inline Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim> NoisyDescriptor(
    const Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim>& descriptor, Random& random) {
  Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim> noisy;
  for (int i = 0; i < kSiftDescriptorDim; ++i) {
    noisy[i] = static_cast<uint8_t>(std::clamp<double>(std::round(random.Normal(descriptor[i], 8)), 0, 255));
  }
  return noisy;
}

// Standing at a place, looking level towards `heading_deg` (counter-clockwise from +x).
inline Pose PoseAt(const Eigen::Vector3d& center, double heading_deg) {
  const double heading = RadFromDeg(heading_deg);
  Eigen::Matrix3d cam_from_world;
  cam_from_world.row(0) = Eigen::RowVector3d(std::sin(heading), -std::cos(heading), 0);  // right
  cam_from_world.row(1) = Eigen::RowVector3d(0, 0, -1);                                  // down
  cam_from_world.row(2) = Eigen::RowVector3d(std::cos(heading), std::sin(heading), 0);   // forward
  Pose pose;
  pose.rotation = Eigen::Quaterniond(cam_from_world);
  pose.translation = -(pose.rotation * center);
  return pose;
}

struct RenderOptions {
  double keypoint_sigma_px = 0.5;  // as MeasurementOptions
  double keypoint_sigma_per_scale = 0.2;
  double detection_ratio = 0.7;
  int num_outliers = 100;        // keypoints that show no landmark
  double num_swapped_ratio = 0;  // part of the keypoints that show a wrong landmark's descriptor
};

// Features of the room seen from a pose.
inline Features RenderFeatures(const SyntheticRoom& room, const Pose& cam_from_world,
                               const RenderOptions& options, uint64_t seed) {
  Random random(seed);
  Features features;
  std::vector<Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim>> descriptors;
  for (size_t i = 0; i < room.points.size(); ++i) {
    const auto pixel = ImageFromCamera(room.camera, cam_from_world * room.points[i]);
    const bool is_seen = pixel && pixel->x() > 0 && pixel->y() > 0 && pixel->x() < room.camera.width &&
                         pixel->y() < room.camera.height;
    if (!is_seen || random.Uniform() > options.detection_ratio) continue;
    const double scale = random.Uniform(1.5, 5);
    const double sigma = std::hypot(options.keypoint_sigma_px, options.keypoint_sigma_per_scale * scale);
    features.keypoints.push_back({static_cast<float>(random.Normal(pixel->x(), sigma)),
                                  static_cast<float>(random.Normal(pixel->y(), sigma)),
                                  static_cast<float>(scale), 0});
    const bool is_swapped = random.Uniform() < options.num_swapped_ratio;
    const size_t shown = is_swapped ? random.UniformInt(0, room.points.size() - 1) : i;
    descriptors.push_back(NoisyDescriptor(room.descriptors.row(shown), random));
  }
  for (int i = 0; i < options.num_outliers; ++i) {
    features.keypoints.push_back({static_cast<float>(random.Uniform(0, room.camera.width)),
                                  static_cast<float>(random.Uniform(0, room.camera.height)), 2, 0});
    descriptors.push_back(RandomDescriptor(random));
  }
  features.descriptors.resize(static_cast<Eigen::Index>(descriptors.size()), kSiftDescriptorDim);
  for (size_t i = 0; i < descriptors.size(); ++i) features.descriptors.row(i) = descriptors[i];
  return features;
}

// The room without a survey: landmarks and camera.
inline SyntheticRoom MakeUnmappedRoom(uint64_t seed, int num_landmarks) {
  SyntheticRoom room;
  Random random(seed);
  room.descriptors.resize(num_landmarks, kSiftDescriptorDim);
  for (int i = 0; i < num_landmarks; ++i) {
    const double z = random.Uniform(0, 3), along = random.Uniform(-1, 1), depth = random.Uniform(0, 0.3);
    const Eigen::Vector3d walls[] = {{5 - depth, 4 * along, z},
                                     {5 * along, 4 - depth, z},
                                     {-5 + depth, 4 * along, z},
                                     {5 * along, -4 + depth, z}};
    room.points.push_back(walls[i % 4]);
    room.descriptors.row(i) = RandomDescriptor(random);
  }
  room.camera.camera_id = 1;
  room.camera.model = CameraModel::kSimpleRadial;
  room.camera.width = 640;
  room.camera.height = 480;
  room.camera.params = {500, 320, 240, -0.05};
  return room;
}

inline SyntheticRoom MakeSyntheticRoom(uint64_t seed, int num_landmarks = 1600) {
  SyntheticRoom room = MakeUnmappedRoom(seed, num_landmarks);
  MapRows& rows = room.rows;
  rows.name = "room";
  rows.writer = "cairn test";
  rows.cameras = {room.camera};
  for (const Eigen::Vector3d& point : room.points) {
    rows.landmarks.push_back(
        {.class_id = static_cast<ClassId>(rows.landmarks.size()), .position = point, .num_observations = 3});
  }
  rows.descriptors = room.descriptors;
  std::vector<build_vocabulary::ImageDescriptors> documents;
  rows.regions.resize(8);  // one per heading
  for (double x = -3; x <= 3; x += 1.5) {
    for (double y = -2; y <= 2; y += 2) {
      for (int heading = 0; heading < 8; ++heading) {
        const StationIdx station = static_cast<StationIdx>(rows.stations.size());
        MapImage image{.image_id = static_cast<ImageId>(station + 1),
                       .name = "survey" + std::to_string(station),
                       .camera_id = 1,
                       .cam_from_world = PoseAt({x, y, 1.2}, 45.0 * heading),
                       .station = station};
        for (size_t i = 0; i < room.points.size(); ++i) {
          const auto pixel = ImageFromCamera(room.camera, image.cam_from_world * room.points[i]);
          if (pixel && pixel->x() > 0 && pixel->y() > 0 && pixel->x() < 640 && pixel->y() < 480) {
            image.landmarks.push_back(static_cast<LandmarkIdx>(i));
          }
        }
        documents.push_back(
            {image.image_id,
             RenderFeatures(room, image.cam_from_world, {}, MixSeed(seed, 1000 + station)).descriptors});
        std::vector<LandmarkIdx>& kept = rows.regions[heading].landmarks;
        kept.insert(kept.end(), image.landmarks.begin(), image.landmarks.end());
        rows.regions[heading].stations.push_back(station);
        rows.stations.push_back({.position = {x, y}, .heading_deg = 45.0 * heading});
        rows.images.push_back(std::move(image));
      }
    }
  }
  for (MapRegion& region : rows.regions) {
    std::sort(region.landmarks.begin(), region.landmarks.end());
    region.landmarks.erase(std::unique(region.landmarks.begin(), region.landmarks.end()),
                           region.landmarks.end());
  }
  NoProgress progress;
  build_vocabulary::BuildVocabularyOptions
      options;  // few words, as those of a large survey: images from elsewhere share some
  options.tree.descriptors_per_word = 40;
  options.tree.min_num_descriptors_to_split = 20;
  rows.vocabulary = *build_vocabulary::BuildVocabulary(documents, {}, options, seed, 2, progress);
  return room;
}

// A free pose in the room.
inline Pose RandomPose(Random& random) {
  return PoseAt({random.Uniform(-3.3, 3.3), random.Uniform(-2.3, 2.3), random.Uniform(1, 1.5)},
                random.Uniform(0, 360));
}

// The map with every landmark moved by noise of the covariance that it states.
inline MapRows WithLandmarkNoise(const SyntheticRoom& room, double sigma_m, Random& random) {
  MapRows rows = room.rows;
  for (MapLandmark& landmark : rows.landmarks) {
    const Eigen::Vector3d sigmas(sigma_m, 0.5 * sigma_m, 2 * sigma_m);
    landmark.covariance = sigmas.cwiseAbs2().asDiagonal();
    for (int axis = 0; axis < 3; ++axis) landmark.position[axis] += random.Normal(0, sigmas[axis]);
  }
  return rows;
}

}  // namespace cairn
