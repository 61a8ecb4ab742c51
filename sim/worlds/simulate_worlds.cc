#include "sim/worlds/simulate_worlds.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/geometry/pose.h"
#include "sim/worlds/walls.h"

namespace cairn::sim {
namespace {

constexpr double kWallCellM = 2.0;

// Lattice points of the perimeter's box; those in free space are stations.
struct Lattice {
  double spacing_m;
  int min_column, min_row, num_columns, num_rows;
  std::vector<StationIdx> station_at;  // row by row; -1: no station

  Lattice(const Eigen::AlignedBox2d& box, double spacing) : spacing_m(spacing) {
    min_column = static_cast<int>(std::ceil(box.min().x() / spacing));
    min_row = static_cast<int>(std::ceil(box.min().y() / spacing));
    num_columns = static_cast<int>(std::floor(box.max().x() / spacing)) - min_column + 1;
    num_rows = static_cast<int>(std::floor(box.max().y() / spacing)) - min_row + 1;
    station_at.assign(static_cast<size_t>(num_columns) * num_rows, -1);
  }
  Eigen::Vector2d Position(int column, int row) const {
    return Eigen::Vector2d(min_column + column, min_row + row) * spacing_m;
  }
  StationIdx& At(int column, int row) { return station_at[static_cast<size_t>(row) * num_columns + column]; }
  StationIdx At(int column, int row) const {
    return station_at[static_cast<size_t>(row) * num_columns + column];
  }
  bool IsInside(int column, int row) const {
    return column >= 0 && row >= 0 && column < num_columns && row < num_rows;
  }
};

// Marks lattice points in free space with 0, the others with -1: along each row, free space begins and ends
// at walls.
void MarkFreeSpace(const WallIndex& walls, Lattice* lattice) {
  for (int row = 0; row < lattice->num_rows; ++row) {
    const double y = lattice->Position(0, row).y();
    Eigen::AlignedBox2d line(lattice->Position(0, row) - Eigen::Vector2d(lattice->spacing_m, 0));
    line.extend(lattice->Position(lattice->num_columns, row));
    std::vector<double> crossings;
    for (const auto& [a, b] : walls.Near(line)) {
      if ((a.y() > y) != (b.y() > y))
        crossings.push_back(a.x() + (b.x() - a.x()) * (y - a.y()) / (b.y() - a.y()));
    }
    std::sort(crossings.begin(), crossings.end());
    size_t next = 0;
    for (int column = 0; column < lattice->num_columns; ++column) {
      while (next < crossings.size() && crossings[next] <= lattice->Position(column, row).x()) ++next;
      // Inside of the perimeter and outside of the obstacles, which do not overlap: after an odd number
      // of walls.
      if (next % 2 == 1) lattice->At(column, row) = 0;
    }
  }
}

bool IsPassage(const WallIndex& walls, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  Eigen::AlignedBox2d box(from);
  box.extend(to);
  for (const auto& [a, b] : walls.Near(box)) {
    if (SegmentsCross(from, to, a, b)) return false;
  }
  return true;
}

// Numbers the largest connected part of the free lattice points, row by row, and links neighbours.
void MakeStations(const WallIndex& walls, Lattice* lattice, World* world) {
  constexpr std::pair<int, int> kSteps[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  // Passages to the right and up, per lattice point.
  std::vector<char> passages(lattice->station_at.size(), 0);
  const auto index = [&](int column, int row) {
    return static_cast<size_t>(row) * lattice->num_columns + column;
  };
  // [Sala06 Def. 3.1] E: lattice points a spacing apart with no wall between
  for (int row = 0; row < lattice->num_rows; ++row) {
    for (int column = 0; column < lattice->num_columns; ++column) {
      for (int way = 0; way < 2 && lattice->At(column, row) == 0; ++way) {
        const int c = column + kSteps[way].first, r = row + kSteps[way].second;
        if (!lattice->IsInside(c, r) || lattice->At(c, r) < 0) continue;
        if (IsPassage(walls, lattice->Position(column, row), lattice->Position(c, r))) {
          passages[index(column, row)] |= static_cast<char>(1 << way);
        }
      }
    }
  }
  const auto has_passage = [&](int column, int row, int way) {
    const int c = column + kSteps[way].first, r = row + kSteps[way].second;
    if (!lattice->IsInside(c, r)) return false;
    return way < 2 ? (passages[index(column, row)] >> way & 1) != 0
                   : (passages[index(c, r)] >> (way - 2) & 1) != 0;
  };
  std::vector<int> part(lattice->station_at.size(), -1);
  std::vector<int> sizes;
  for (int row = 0; row < lattice->num_rows; ++row) {
    for (int column = 0; column < lattice->num_columns; ++column) {
      if (lattice->At(column, row) < 0 || part[index(column, row)] >= 0) continue;
      std::vector<std::pair<int, int>> stack = {{column, row}};
      const int id = static_cast<int>(sizes.size());
      part[index(column, row)] = id;
      sizes.push_back(0);
      while (!stack.empty()) {
        const auto [c, r] = stack.back();
        stack.pop_back();
        ++sizes[id];
        for (int way = 0; way < 4; ++way) {
          if (!has_passage(c, r, way)) continue;
          const int next_c = c + kSteps[way].first, next_r = r + kSteps[way].second;
          if (part[index(next_c, next_r)] >= 0) continue;
          part[index(next_c, next_r)] = id;
          stack.emplace_back(next_c, next_r);
        }
      }
    }
  }
  const int largest = static_cast<int>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  for (int row = 0; row < lattice->num_rows; ++row) {
    for (int column = 0; column < lattice->num_columns; ++column) {
      StationIdx& station = lattice->At(column, row);
      station = station == 0 && part[index(column, row)] == largest ? world->num_stations() : -1;
      if (station < 0) continue;
      world->positions.push_back(lattice->Position(column, row));
      for (int way = 3; way >= 2; --way) {
        if (!has_passage(column, row, way)) continue;
        world->edges.emplace_back(lattice->At(column + kSteps[way].first, row + kSteps[way].second), station);
      }
    }
  }
  std::sort(world->edges.begin(), world->edges.end());
}

// The stations that see a feature, ascending.
std::vector<StationIdx> VisibilityArea(const SimulatedFeature& feature, const WallIndex& walls,
                                       const Lattice& lattice) {
  // The box of the sector: its apex, the ends of its arc, and where the arc reaches furthest along an axis.
  const double half_rad = RadFromDeg(feature.opening_deg / 2);
  Eigen::AlignedBox2d box(feature.position);
  for (const double turn : {-half_rad, 0.0, half_rad}) {
    box.extend(feature.position +
               feature.far_m / std::cos(half_rad / 2) * (Eigen::Rotation2Dd(turn) * feature.normal));
  }
  std::vector<WallIndex::Wall> near;
  for (const WallIndex::Wall& wall : walls.Near(box)) {
    // A wall whose ends both lie behind the feature's wall, or on it, hides nothing.
    const double side_a = (wall.first - feature.position).dot(feature.normal);
    const double side_b = (wall.second - feature.position).dot(feature.normal);
    if (std::max(side_a, side_b) > 1e-9) near.push_back(wall);
  }
  std::vector<StationIdx> area;
  const double min_cosine = std::cos(half_rad);
  const int first_row =
      std::max(0, static_cast<int>(std::ceil(box.min().y() / lattice.spacing_m)) - lattice.min_row);
  const int last_row =
      std::min(lattice.num_rows - 1,
               static_cast<int>(std::floor(box.max().y() / lattice.spacing_m)) - lattice.min_row);
  const int first_column =
      std::max(0, static_cast<int>(std::ceil(box.min().x() / lattice.spacing_m)) - lattice.min_column);
  const int last_column =
      std::min(lattice.num_columns - 1,
               static_cast<int>(std::floor(box.max().x() / lattice.spacing_m)) - lattice.min_column);
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      const StationIdx station = lattice.At(column, row);
      if (station < 0) continue;
      const Eigen::Vector2d position = lattice.Position(column, row);
      const Eigen::Vector2d ray = position - feature.position;
      const double distance = ray.norm();
      // [Sala06 §VI] within the visibility range and the angular extent, read as the full opening
      if (distance < feature.near_m || distance > feature.far_m) continue;
      if (ray.dot(feature.normal) < min_cosine * distance) continue;
      // The ray starts off its own wall.
      const Eigen::Vector2d start = feature.position + 1e-6 * ray;
      const bool hidden = std::any_of(near.begin(), near.end(), [&](const WallIndex::Wall& wall) {
        return SegmentsCross(start, position, wall.first, wall.second);
      });
      if (!hidden) area.push_back(station);
    }
  }
  return area;
}

}  // namespace

OptionTable DescribeOptions(SimulateWorldsOptions* o) {
  return {
      {.name = "setting",
       .value = &o->setting,
       .help = "setting of Sala06 §VI-A: 1, 2 rectangular; 3, 4 irregular; 2, 4 with widely visible features",
       .min = 1,
       .max = 4},
      {.name = "num_features",
       .value = &o->num_features,
       .help = "number of features; 0: the setting's, about 100 visible from a station",
       .min = 0,
       .max = 1e7},
      {.name = "spacing_m",
       .value = &o->spacing_m,
       .help = "distance between stations (Sala06: 0.5)",
       .min = 0.01,
       .max = 10},
      {.name = "radius_m",
       .value = &o->radius_m,
       .help = "mean distance of the perimeter's vertices from its middle, or half of a rectangle's side",
       .min = 2,
       .max = 1e4},
      {.name = "min_obstacle_radius_m",
       .value = &o->min_obstacle_radius_m,
       .help = "least distance of an obstacle's vertices from its middle",
       .min = 0.01,
       .max = 100},
      {.name = "max_obstacle_radius_m",
       .value = &o->max_obstacle_radius_m,
       .help = "largest distance of an obstacle's vertices from its middle",
       .min = 0.01,
       .max = 100},
      {.name = "area_scale",
       .value = &o->area_scale,
       .help = "multiplies the area, and the numbers of obstacles and features",
       .min = 0.01,
       .max = 1e4},
  };
}

World SampleFloorPlan(const WorldPlan& plan, double spacing_m) {
  WallIndex walls({plan.perimeter}, kWallCellM);
  for (const Polygon& obstacle : plan.obstacles) walls.Add(obstacle);
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& vertex : plan.perimeter) box.extend(vertex);
  World world;
  world.lattice_spacing_m = spacing_m;
  Lattice lattice(box, spacing_m);
  MarkFreeSpace(walls, &lattice);
  if (std::find(lattice.station_at.begin(), lattice.station_at.end(), 0) == lattice.station_at.end())
    return world;
  MakeStations(walls, &lattice, &world);
  for (const SimulatedFeature& feature : plan.features) {
    world.areas.push_back(VisibilityArea(feature, walls, lattice));
  }
  return world;
}

Result<World> SimulateWorld(const SimulateWorldsOptions& options, uint64_t seed) {
  SimulateWorldsOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (options.min_obstacle_radius_m > options.max_obstacle_radius_m) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "option min_obstacle_radius_m = {:g} exceeds max_obstacle_radius_m = {:g}",
                     options.min_obstacle_radius_m, options.max_obstacle_radius_m);
  }
  World world = SampleFloorPlan(DrawFloorPlan(options, seed), options.spacing_m);
  if (world.num_stations() == 0)
    return MakeError(ErrorCode::kNoData, "the floor plan has no free lattice point");
  return world;
}

}  // namespace cairn::sim
