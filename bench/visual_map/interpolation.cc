// interpolation MAP: how well landmark models of a lattice survey predict sights that are left out: the mean
// of the four neighbours on the lattice (what bilinear and Delaunay interpolation make of them), a Gaussian
// process of one kernel for all, and of each model's own.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <fmt/format.h>

#include "core/blocks/map_rows.h"
#include "core/geometry/floor_pose.h"

namespace {

using namespace cairn;

struct Errors {
  std::vector<double> px, octaves;
  void Add(const Eigen::Vector3d& error) {
    px.push_back(error.head<2>().norm());
    octaves.push_back(std::abs(error.z()));
  }
  void Print(const char* name) {
    const auto quantile = [](std::vector<double>& values, double part) {
      std::sort(values.begin(), values.end());
      return values.empty() ? 0 : values[static_cast<size_t>(part * static_cast<double>(values.size() - 1))];
    };
    double sum = 0;
    for (const double value : px) sum += value * value;
    fmt::print("| {} | {} | {:.2f} | {:.2f} | {:.2f} | {:.3f} |\n", name, px.size(),
               std::sqrt(sum / static_cast<double>(std::max<size_t>(px.size(), 1))), quantile(px, 0.5),
               quantile(px, 0.9), quantile(octaves, 0.5));
  }
};

// Sights a spacing away along the axes; empty if not all four are there.
std::vector<int> Neighbours(const std::vector<Sight>& sights, size_t of, double spacing_m) {
  std::vector<int> found;
  for (const Eigen::Vector2d& step :
       {Eigen::Vector2d(1, 0), Eigen::Vector2d(-1, 0), Eigen::Vector2d(0, 1), Eigen::Vector2d(0, -1)}) {
    for (size_t i = 0; i < sights.size(); ++i) {
      if ((sights[i].place - sights[of].place - spacing_m * step).norm() < 0.1 * spacing_m)
        found.push_back(static_cast<int>(i));
    }
  }
  if (found.size() != 4) found.clear();
  return found;
}

}  // namespace

int main(int argc, char** argv) {
  const double spacing_m = argc > 2 ? std::atof(argv[2]) : 0.25;
  const auto rows = ReadMapRows(argc > 1 ? argv[1] : "");
  if (!rows.ok()) {
    std::fprintf(stderr, "%s\n", rows.error().message.c_str());
    return 1;
  }
  Errors lattice, one_kernel, own_kernel;
  for (const std::vector<HeadingModel>& models : rows->visual_map.landmarks) {
    for (const HeadingModel& model : models) {
      std::vector<Sight> sights;
      for (const LandmarkSight& sight : model.sights) {
        const Pose pose = rows->camera_from_given.Inverse() * rows->images[sight.image].cam_from_world;
        sights.push_back({FloorPoseOf(pose, rows->floor_from_world).position, sight.seen.cast<double>()});
      }
      const auto of_one = LandmarkModel::LeaveOneOutErrors(sights, {.length = 1, .noise = 2});
      const auto of_own = LandmarkModel::LeaveOneOutErrors(sights, model.shape);
      if (!of_one || !of_own) continue;
      for (size_t i = 0; i < sights.size(); ++i) {
        const std::vector<int> neighbours = Neighbours(sights, i, spacing_m);
        if (neighbours.empty()) continue;
        Eigen::Vector3d mean = Eigen::Vector3d::Zero();
        for (const int k : neighbours) mean += sights[k].seen / 4;
        lattice.Add(mean - sights[i].seen);
        one_kernel.Add(of_one->col(static_cast<Eigen::Index>(i)));
        own_kernel.Add(of_own->col(static_cast<Eigen::Index>(i)));
      }
    }
  }
  fmt::print("| | sights | rms px | median | 90 % | median octaves |\n|---|--:|--:|--:|--:|--:|\n");
  lattice.Print("bilinear on the lattice");
  one_kernel.Print("Gaussian process, 1 m, noise 0.001");
  own_kernel.Print("Gaussian process, kernel by cross-validation");
  return 0;
}
