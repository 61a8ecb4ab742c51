#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "tests/runtime/localize/synthetic_room.h"

namespace cairn {

// The synthetic room with a map of k landmarks a region and no others: a region is two neighbouring places
// and a heading.
struct RegionRoom {
  SyntheticRoom room;
  std::vector<Pose> middles;  // of every region: half-way between its two places

  explicit RegionRoom(size_t k, uint64_t seed = 3) : room(MakeUnmappedRoom(seed, 4000)) {
    MapRows& rows = room.rows;
    rows.name = "regions";
    rows.writer = "cairn test";
    rows.cameras = {room.camera};
    std::vector<std::vector<int>> of_region;
    for (const double x : {-3.0, -1.0, 1.0}) {
      for (const double y : {-2.0, 0.0, 2.0}) {
        for (int heading = 0; heading < 8; ++heading) {
          const Pose places[] = {PoseAt({x, y, 1.2}, 45.0 * heading),
                                 PoseAt({x + 1, y, 1.2}, 45.0 * heading)};
          middles.push_back(PoseAt({x + 0.5, y, 1.2}, 45.0 * heading));
          std::vector<int> common;
          for (int i = 0; i < static_cast<int>(room.points.size()); ++i) {
            if (Sees(places[0], i) && Sees(places[1], i)) common.push_back(i);
          }
          EXPECT_GE(common.size(), k);
          for (size_t i = 0; i < k; ++i) {  // spread over what there is
            std::swap(common[i], common[i + (common.size() - i) / 2]);
          }
          common.resize(k);
          of_region.push_back(std::move(common));
          MapRegion& region = rows.regions.emplace_back();
          for (const Pose& place : places) {
            const auto station = static_cast<StationIdx>(rows.stations.size());
            region.stations.push_back(station);
            rows.stations.push_back({.position = place.Center().head<2>(), .heading_deg = 45.0 * heading});
            rows.images.push_back({.image_id = static_cast<ImageId>(station + 1),
                                   .name = "survey" + std::to_string(station),
                                   .camera_id = 1,
                                   .cam_from_world = place,
                                   .station = station});
          }
        }
      }
    }
    std::vector<int> kept;
    for (const std::vector<int>& points : of_region) kept.insert(kept.end(), points.begin(), points.end());
    std::sort(kept.begin(), kept.end());
    kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
    rows.descriptors.resize(static_cast<Eigen::Index>(kept.size()), kSiftDescriptorDim);
    for (size_t i = 0; i < kept.size(); ++i) {
      rows.landmarks.push_back(
          {.class_id = static_cast<ClassId>(i), .position = room.points[kept[i]], .num_observations = 3});
      rows.descriptors.row(static_cast<Eigen::Index>(i)) = room.descriptors.row(kept[i]);
      for (MapImage& image : rows.images) {
        if (Sees(image.cam_from_world, kept[i])) image.landmarks.push_back(static_cast<LandmarkIdx>(i));
      }
    }
    for (size_t region = 0; region < of_region.size(); ++region) {
      for (const int point : of_region[region]) {
        rows.regions[region].landmarks.push_back(
            static_cast<LandmarkIdx>(std::lower_bound(kept.begin(), kept.end(), point) - kept.begin()));
      }
      std::sort(rows.regions[region].landmarks.begin(), rows.regions[region].landmarks.end());
    }
  }

  bool Sees(const Pose& cam_from_world, int point) const {
    const auto pixel = ImageFromCamera(room.camera, cam_from_world * room.points[point]);
    return pixel && pixel->x() > 0 && pixel->y() > 0 && pixel->x() < room.camera.width &&
           pixel->y() < room.camera.height;
  }
};

}  // namespace cairn
