#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/geometry/pose.h"

namespace cairn {

// A world instance <G, F, {F_v}> [Sala06 Def. 3.3]: stations, their adjacency, and the visibility area of
// every feature.  Memory is proportional to the number of incidences (station sees feature).
struct World {
  // Places of the stations on the floor, metres.
  std::vector<Eigen::Vector2d> positions;
  // Headings of the stations, degrees counter-clockwise from +x; empty where stations see all around.
  std::vector<double> headings_deg;
  // Undirected edges of contiguous stations, u < v, ascending, no duplicates.
  std::vector<std::pair<StationIdx, StationIdx>> edges;
  // Per feature: the stations that see it, ascending.
  std::vector<std::vector<StationIdx>> areas;

  // For worlds made by filter_visibility, else empty: the feature class behind each feature, and the images
  // taken at each station.
  std::vector<ClassId> class_ids;
  std::vector<std::vector<ImageId>> station_images;
  // Edge length of a lattice survey, metres; 0 where stations are cells of a driven survey or the world
  // is synthetic.
  double lattice_spacing_m = 0;
  // Floor frame (z up; x, y and heading of stations, plans and pictures) from the capture's world frame.
  Pose floor_from_world;

  int num_stations() const { return static_cast<int>(positions.size()); }
  int num_features() const { return static_cast<int>(areas.size()); }
  // Pairs of a feature and a station that sees it.
  int64_t num_incidences() const {
    int64_t num = 0;
    for (const std::vector<StationIdx>& area : areas) num += static_cast<int64_t>(area.size());
    return num;
  }
};

// F_v for every station: the features seen from it, ascending.
std::vector<std::vector<FeatureIdx>> VisibilitySets(const World& world);
// Neighbours of every station, ascending.
std::vector<std::vector<StationIdx>> AdjacencyLists(const World& world);

// Errors: InvalidArgument, naming the element: an index out of range, a self-edge or duplicate edge, an area
// that is not strictly ascending, two stations at one place with one heading, sizes of the optional members
// that differ.
Status CheckWorld(const World& world);

// World JSON (docs: schemas/world.md).  Read accepts any order and sorts.
// Errors: NotFound, Corrupt (not JSON, truncated), InvalidArgument (CheckWorld), each naming the file.
Result<World> ReadWorldJson(const std::string& path);
Status WriteWorldJson(const World& world, const std::string& path);
// world.db (schemas/world.sql): what filter_visibility writes.
Result<World> ReadWorldDatabase(const std::string& path);
Status WriteWorldDatabase(const World& world, const std::string& path);
// Recognises the file by its first bytes.
Result<World> ReadWorld(const std::string& path);

}  // namespace cairn
