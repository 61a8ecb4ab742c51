#pragma once

#include "core/blocks/map_rows.h"

namespace cairn {

// Five landmarks, four images, three stations, two regions, three nodes; in the values of a file.
inline MapRows SmallRows() {
  MapRows rows;
  for (int i = 0; i < 5; ++i) {
    rows.landmarks.push_back({.class_id = static_cast<ClassId>(10 + i),
                              .position = {0.5 * i, 1, 2},
                              .covariance = Eigen::Matrix3d::Identity() * 1e-6,
                              .scale_m = 1e-6,
                              .num_observations = 3});
  }
  rows.descriptors = DescriptorMatrix::Constant(5, kSiftDescriptorDim, 7);
  rows.stations = {{.position = {0, 0}, .heading_deg = 90},
                   {.position = {1, 0}, .heading_deg = -12.345, .is_covered = false},
                   {.position = {-2.5, 0.25}}};
  rows.station_edges = {{0, 1}, {0, 2}, {1, 2}};
  const auto image = [&](ImageId id, const std::string& name, StationIdx station,
                         std::vector<LandmarkIdx> seen) {
    MapImage row{
        .image_id = id, .name = name, .camera_id = 3, .station = station, .landmarks = std::move(seen)};
    row.cam_from_world.translation = {0.5, -0.0001 * id, 0};
    rows.images.push_back(row);
  };
  image(1, "a/1.jpg", 0, {0, 1, 2});
  image(2, "a/2.jpg", 1, {1, 2});
  image(4, "a/4.jpg", 1, {2, 3});
  image(7, "b/1.jpg", -1, {3, 4});
  rows.regions = {{.stations = {0, 1}, .landmarks = {0, 1, 2}}, {.stations = {1, 2}, .landmarks = {2, 3, 4}}};
  rows.appearance.resize(3);
  rows.appearance[0] = {.images = {0},
                        .is_kept = true,
                        .links = {{1, 20}, {2, 30}},
                        .entropy = 0.25,
                        .look_alikes = {{2, 0.5}}};
  rows.appearance[1] = {
      .images = {1}, .is_kept = true, .links = {{2, 40}}, .entropy = 0.5, .look_alikes = {}};
  rows.appearance[2] = {.images = {2, 3}, .is_kept = false, .links = {}, .entropy = 1.5, .look_alikes = {}};
  return rows;
}

// The same without landmark 1, image 2, station 1 and node 1; a landmark in the middle and one at the end, an
// image and its node in the middle and a station at the beginning are new.
inline MapRows ChangedRows() {
  MapRows rows = SmallRows();
  const std::vector<MapLandmark> old = rows.landmarks;
  MapLandmark added = old[0];
  added.class_id = 20;
  MapLandmark last = old[0];
  last.class_id = 21;
  rows.landmarks = {old[0], old[2], added, old[3], old[4], last};
  rows.descriptors = DescriptorMatrix::Constant(6, kSiftDescriptorDim, 7);
  rows.stations = {{.position = {5, 5}}, rows.stations[0], rows.stations[2]};
  rows.station_edges = {{0, 1}, {1, 2}};
  rows.images[1].image_id = 3;
  rows.images[1].name = "a/3.jpg";
  rows.images[0].station = 1;
  rows.images[1].station = 0;
  rows.images[2].station = 2;
  rows.images[0].landmarks = {0, 1, 2};
  rows.images[1].landmarks = {2, 5};
  rows.images[2].landmarks = {1, 3};
  rows.images[3].landmarks = {4};
  rows.regions = {{.stations = {1}, .landmarks = {0, 1}},
                  {.stations = {0, 2}, .landmarks = {1, 2, 3, 4, 5}},
                  {.stations = {0}, .landmarks = {5}}};
  rows.appearance[1] = {.images = {1}, .is_kept = false, .links = {}, .entropy = 0.125, .look_alikes = {}};
  rows.appearance[0].links = {{1, 25}, {2, 30}};
  rows.appearance[0].look_alikes = {{1, 0.75}, {2, 0.5}};
  return rows;
}

}  // namespace cairn
