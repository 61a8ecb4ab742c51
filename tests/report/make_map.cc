// Maps that no survey makes, for the page's tests and benchmark:
//   make_map MAP                                   nothing in it
//   make_map MAP NAME                              one station, image and landmark; map and image have this
//   name make_map MAP LANDMARKS STATIONS REGIONS        a lattice of stations with four headings, regions of
//   neighbours; of two surveys, between which two places changed
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "core/base/random.h"
#include "core/blocks/map_rows.h"
#include "core/world/drop_reason.h"

namespace cairn {
namespace {

Camera SomeCamera() {
  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 320, 240};
  return camera;
}

MapRows Head(const std::string& name) {
  MapRows rows;
  rows.name = name;
  rows.writer = "cairn test";
  rows.cameras = {SomeCamera()};
  rows.descriptors.resize(0, kSiftDescriptorDim);
  return rows;
}

MapRows Named(const std::string& name) {
  MapRows rows = Head(name);
  rows.descriptors = DescriptorMatrix::Constant(1, kSiftDescriptorDim, 7);
  rows.landmarks = {{.class_id = 1, .position = {1, 2, 0}, .num_observations = 1}};
  rows.stations = {{.position = {0, 0}, .heading_deg = 90}};
  rows.images = {{.image_id = 1, .name = name, .camera_id = 1, .station = 0, .landmarks = {0}}};
  rows.regions = {{.stations = {0}, .landmarks = {0}}};
  return rows;
}

MapRows Lattice(int num_landmarks, int num_stations, int num_regions) {
  MapRows rows = Head("lattice");
  Random random(1);
  const int side = std::max(1, static_cast<int>(std::sqrt(num_stations / 4.0)));
  const auto place = [&](int station) {
    return Eigen::Vector2d(0.5 * (station / 4 % side), 0.5 * (station / 4 / side));
  };
  rows.k = 40;
  rows.descriptors = DescriptorMatrix::Constant(num_landmarks, kSiftDescriptorDim, 40);
  for (int i = 0; i < num_landmarks; ++i) {
    rows.landmarks.push_back(
        {.class_id = static_cast<ClassId>(i),
         .position = {random.Uniform(0, 0.5 * side), random.Uniform(0, 0.5 * side), random.Uniform(0, 3)},
         .num_observations = 3 + static_cast<int>(random.UniformInt(0, 30))});
  }
  DropCount few{.reason_id = static_cast<int>(DropReason::kFewFeatures), .num_dropped = 0};
  const DropReasonEntry& entry = DescribeDropReason(DropReason::kFewFeatures);
  few.stage = entry.stage;
  few.kind = DropKindName(entry.kind);
  few.name = entry.name;
  few.text = entry.text;
  for (int i = 0; i < num_stations; ++i) {
    const bool is_covered = random.Uniform() > 0.03;
    rows.stations.push_back({.position = place(i), .heading_deg = 90.0 * (i % 4), .is_covered = is_covered});
    few.at_stations.push_back(is_covered ? 0 : 1);
    few.num_dropped += is_covered ? 0 : 1;
    MapImage image{.image_id = static_cast<ImageId>(i + 1),
                   .name = "image" + std::to_string(i) + ".jpg",
                   .camera_id = 1,
                   .station = i};
    image.cam_from_world.translation = {-place(i).x(), -place(i).y(), 0};
    for (int k = 0; k < 60; ++k)
      image.landmarks.push_back(static_cast<LandmarkIdx>(random.UniformInt(0, num_landmarks - 1)));
    std::sort(image.landmarks.begin(), image.landmarks.end());
    image.landmarks.erase(std::unique(image.landmarks.begin(), image.landmarks.end()), image.landmarks.end());
    rows.images.push_back(std::move(image));
    if (i >= 4 && i / 4 % side > 0) rows.station_edges.emplace_back(i - 4, i);
  }
  rows.findings.drops = {few};
  if (num_stations > 1) {
    rows.sessions = {"monday", "tuesday"};
    const double half = 0.25 * side;
    rows.findings.changes = {{1, {half, half, 1}, 0.4, 50, 20, 0, 1}, {1, {0, half, 1}, 0.3, 0, 12, -1, 1}};
  }
  for (int region = 0; region < num_regions; ++region) {
    MapRegion row;
    const int first = static_cast<int>(static_cast<int64_t>(num_stations) * region / num_regions);
    const int end = static_cast<int>(static_cast<int64_t>(num_stations) * (region + 1) / num_regions);
    for (int i = first; i < end; ++i) row.stations.push_back(i);
    for (int k = 0; k < 40; ++k)
      row.landmarks.push_back(static_cast<LandmarkIdx>(
          (static_cast<int64_t>(num_landmarks) * region / num_regions + k) % num_landmarks));
    std::sort(row.landmarks.begin(), row.landmarks.end());
    rows.regions.push_back(std::move(row));
  }
  return rows;
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  if (argc != 2 && argc != 3 && argc != 5) {
    std::fprintf(stderr, "usage: make_map MAP [NAME | LANDMARKS STATIONS REGIONS]\n");
    return 2;
  }
  const cairn::MapRows rows = argc == 5
                                  ? cairn::Lattice(std::atoi(argv[2]), std::atoi(argv[3]), std::atoi(argv[4]))
                              : argc == 3 ? cairn::Named(argv[2])
                                          : cairn::Head("empty");
  const cairn::Status status = cairn::WriteMapRows(rows, argv[1]);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
