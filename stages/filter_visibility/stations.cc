#include "stages/filter_visibility/stations.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>
#include <tuple>

#include "core/base/quantiles.h"
#include "core/geometry/floor_pose.h"

namespace cairn::filter_visibility {
namespace {

// Headings at one place that are this far apart mean that the robot turned there.
constexpr double kTurnedDeg = 30;
// Largest distance from a grid point, in grid spacings, at which a place lies on the grid.
constexpr double kOnGridRatio = 0.2;
// Positions are rounded to the micrometre, so that the last bits of a refinement have no effect.
double Quantized(double metres) { return std::round(metres * 1e6) / 1e6; }

Result<Eigen::Vector3d> UpDirection(const std::vector<SurveyImage>& images,
                                    const FilterVisibilityOptions& options) {
  if (options.up != "auto") {
    std::vector<double> values;
    CAIRN_RETURN_IF_ERROR(SetOption({.name = "up", .value = &values}, options.up));
    if (values.size() != 3 || Eigen::Vector3d(values[0], values[1], values[2]).norm() < 1e-9) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "option up = '{}': expected 'auto' or a direction 'x,y,z'", options.up);
    }
    return Eigen::Vector3d(values[0], values[1], values[2]);
  }
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const SurveyImage& image : images)
    up -= image.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitY();
  if (up.norm() < 1e-3 * static_cast<double>(images.size())) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "the cameras' up directions cancel out: give the option up = 'x,y,z' in the world frame");
  }
  up.normalize();
  Eigen::Index axis = 0;
  up.cwiseAbs().maxCoeff(&axis);
  if (DegFromRad(std::acos(std::min(1.0, std::abs(up[axis])))) <= options.up_snap_deg) {
    const double sign = up[axis] > 0 ? 1.0 : -1.0;
    up = sign * Eigen::Vector3d::Unit(axis);
  }
  return up;
}

// A place at which one or several images were taken.
struct Place {
  Eigen::Vector2d position;  // of its first image
  double heading_deg;        // of its first image
  bool turned = false;       // another image heads elsewhere
};

// Images within `same_place_m` of a place's first image belong to it.
std::vector<Place> GroupPlaces(const std::vector<FloorPose>& poses, double same_place_m) {
  std::vector<Place> places;
  std::map<Cell, std::vector<size_t>> buckets;
  for (const FloorPose& pose : poses) {
    const Cell bucket(static_cast<int>(std::floor(pose.position.x() / same_place_m)),
                      static_cast<int>(std::floor(pose.position.y() / same_place_m)));
    Place* found = nullptr;
    for (int dy = -1; dy <= 1 && !found; ++dy) {
      for (int dx = -1; dx <= 1 && !found; ++dx) {
        const auto entry = buckets.find({bucket.first + dx, bucket.second + dy});
        if (entry == buckets.end()) continue;
        for (const size_t i : entry->second) {
          if ((places[i].position - pose.position).norm() <= same_place_m) found = &places[i];
        }
      }
    }
    if (found) {
      found->turned |= AngleBetweenDeg(found->heading_deg, pose.heading_deg) >= kTurnedDeg;
    } else {
      buckets[bucket].push_back(places.size());
      places.push_back({pose.position, pose.heading_deg});
    }
  }
  return places;
}

// A square grid: grid coordinates of p are rotation^-1 (p - origin) / spacing.
struct Lattice {
  double spacing_m = 0;
  double angle_rad = 0;
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();

  Eigen::Vector2d GridFromFloor(const Eigen::Vector2d& position) const {
    return Eigen::Rotation2Dd(-angle_rad) * (position - origin) / spacing_m;
  }
};

// Calls visit(difference) for each pair of places at most `max_distance` apart.
template <typename Visit>
void VisitNearPairs(const std::vector<Place>& places_by_x, double max_distance, Visit&& visit) {
  for (size_t i = 0; i < places_by_x.size(); ++i) {
    for (size_t j = i + 1; j < places_by_x.size(); ++j) {
      const Eigen::Vector2d difference = places_by_x[j].position - places_by_x[i].position;
      if (difference.x() > max_distance) break;
      if (difference.norm() <= max_distance) visit(difference);
    }
  }
}

double MedianNearestDistance(const std::vector<Place>& places) {
  std::vector<double> nearest(places.size(), std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < places.size(); ++i) {
    for (size_t j = 0; j < places.size(); ++j) {
      if (i != j) nearest[i] = std::min(nearest[i], (places[i].position - places[j].position).norm());
    }
  }
  return UpperMedian(std::move(nearest));
}

// The grid that the places lie on: spacing from neighbouring pairs, direction and origin as circular means.
// Nothing if fewer than nine in ten lie on it.
std::optional<Lattice> FitLattice(std::vector<Place> places) {
  if (places.size() < 4) return std::nullopt;
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
    return std::make_tuple(a.position.x(), a.position.y()) < std::make_tuple(b.position.x(), b.position.y());
  });
  const double nearest = MedianNearestDistance(places);
  Lattice lattice;
  std::complex<double> direction = 0;
  double sum = 0;
  int num_pairs = 0;
  VisitNearPairs(places, 1.2 * nearest, [&](const Eigen::Vector2d& difference) {
    if (difference.norm() < 0.8 * nearest) return;
    direction += std::polar(1.0, 4.0 * std::atan2(difference.y(), difference.x()));
    sum += difference.norm();
    ++num_pairs;
  });
  if (num_pairs == 0) return std::nullopt;
  lattice.spacing_m = sum / num_pairs;
  lattice.angle_rad = std::arg(direction) / 4.0;
  // Circular means of the places' phases give the grid's origin.
  std::complex<double> phase_x = 0, phase_y = 0;
  for (const Place& place : places) {
    const Eigen::Vector2d grid = lattice.GridFromFloor(place.position);
    phase_x += std::polar(1.0, 2.0 * std::numbers::pi * grid.x());
    phase_y += std::polar(1.0, 2.0 * std::numbers::pi * grid.y());
  }
  const Eigen::Vector2d offset =
      Eigen::Vector2d(std::arg(phase_x), std::arg(phase_y)) / (2.0 * std::numbers::pi);
  lattice.origin = Eigen::Rotation2Dd(lattice.angle_rad) * (offset * lattice.spacing_m);
  const auto on_grid = std::count_if(places.begin(), places.end(), [&](const Place& place) {
    const Eigen::Vector2d grid = lattice.GridFromFloor(place.position);
    return (grid - grid.array().round().matrix()).cwiseAbs().maxCoeff() <= kOnGridRatio;
  });
  return 10 * on_grid >= 9 * static_cast<int64_t>(places.size()) ? std::optional(lattice) : std::nullopt;
}

std::optional<Lattice> RecogniseLattice(const std::vector<FloorPose>& poses,
                                        const FilterVisibilityOptions& options) {
  const std::vector<Place> places = GroupPlaces(poses, options.same_place_m);
  const auto turned = std::count_if(places.begin(), places.end(), [](const Place& p) { return p.turned; });
  if (options.survey == "auto" && 2 * turned < static_cast<int64_t>(places.size())) return std::nullopt;
  return FitLattice(places);
}

// Row, column and heading bin of an image.
using Key = std::tuple<int, int, int>;

// Groups images by key into stations, in that order, and links neighbouring rows, columns and heading bins.
// `headings_deg`: of the heading bins; empty where stations have none.
void AssignStations(const std::vector<SurveyImage>& images, const std::vector<Key>& keys,
                    const std::vector<double>& headings_deg, Stations* stations) {
  World& world = stations->world;
  std::map<Key, StationIdx> index;
  for (const Key& key : keys) index[key];
  for (StationIdx next = 0; auto& [key, station] : index) station = next++;
  world.station_images.resize(index.size());
  for (size_t i = 0; i < images.size(); ++i) {
    const StationIdx station = index.at(keys[i]);
    stations->station_of_image[images[i].image_id] = station;
    world.station_images[station].push_back(images[i].image_id);
  }
  for (std::vector<ImageId>& list : world.station_images) std::sort(list.begin(), list.end());

  // [Sala06 Def. 3.1] E: contiguous places are adjacent, and here contiguous headings at one place
  const auto link = [&](StationIdx station, const Key& other) {
    const auto entry = index.find(other);
    if (entry == index.end() || entry->second == station) return;
    world.edges.emplace_back(std::min(station, entry->second), std::max(station, entry->second));
  };
  const int num_headings = std::max<int>(1, static_cast<int>(headings_deg.size()));
  for (const auto& [key, station] : index) {
    const auto [row, column, heading] = key;
    stations->cells.emplace_back(column, row);
    if (!headings_deg.empty()) world.headings_deg.push_back(headings_deg[heading]);
    link(station, {row, column + 1, heading});
    link(station, {row + 1, column, heading});
    link(station, {row, column, (heading + 1) % num_headings});
  }
  std::sort(world.edges.begin(), world.edges.end());
  world.edges.erase(std::unique(world.edges.begin(), world.edges.end()), world.edges.end());
}

void MakeLatticeStations(const std::vector<SurveyImage>& images, const std::vector<FloorPose>& poses,
                         const Lattice& lattice, Stations* stations) {
  std::vector<Key> keys;
  for (const FloorPose& pose : poses) {
    const Eigen::Vector2d grid = lattice.GridFromFloor(pose.position);
    keys.emplace_back(static_cast<int>(std::round(grid.y())), static_cast<int>(std::round(grid.x())), 0);
  }
  AssignStations(images, keys, {}, stations);
  stations->is_lattice = true;
  stations->world.lattice_spacing_m = Quantized(lattice.spacing_m);
  for (size_t i = 0; i < stations->cells.size(); ++i) {
    stations->station_at[stations->cells[i]] = static_cast<StationIdx>(i);
  }
  // A station stands at the mean of its images.
  std::vector<Eigen::Vector2d>& positions = stations->world.positions;
  positions.assign(stations->cells.size(), Eigen::Vector2d::Zero());
  for (size_t i = 0; i < images.size(); ++i) {
    positions[stations->station_of_image.at(images[i].image_id)] += poses[i].position;
  }
  for (size_t i = 0; i < positions.size(); ++i) {
    positions[i] /= static_cast<double>(stations->world.station_images[i].size());
    positions[i] = positions[i].unaryExpr(&Quantized);
  }
}

void MakeDrivenStations(const std::vector<SurveyImage>& images, const std::vector<FloorPose>& poses,
                        const FilterVisibilityOptions& options, Stations* stations) {
  const int num_headings = std::max(1, static_cast<int>(std::lround(360.0 / options.heading_bin_deg)));
  std::vector<Key> keys;
  for (const FloorPose& pose : poses) {
    keys.emplace_back(static_cast<int>(std::floor(pose.position.y() / options.cell_size_m)),
                      static_cast<int>(std::floor(pose.position.x() / options.cell_size_m)),
                      static_cast<int>(std::lround(pose.heading_deg * num_headings / 360.0)) % num_headings);
  }
  std::vector<double> headings_deg;
  for (int i = 0; i < num_headings && num_headings > 1; ++i) headings_deg.push_back(360.0 * i / num_headings);
  AssignStations(images, keys, headings_deg, stations);
  for (const Cell& cell : stations->cells) {
    stations->world.positions.emplace_back(Quantized((cell.first + 0.5) * options.cell_size_m),
                                           Quantized((cell.second + 0.5) * options.cell_size_m));
  }
}

}  // namespace

Pose FloorFromUp(const Eigen::Vector3d& up) {
  Pose floor_from_world;
  const Eigen::Vector3d direction = up.normalized();
  if ((direction - Eigen::Vector3d::UnitZ()).norm() > 1e-6) {
    floor_from_world.rotation = Eigen::Quaterniond::FromTwoVectors(direction, Eigen::Vector3d::UnitZ());
  }
  return floor_from_world;
}

Result<Stations> FindStations(const std::vector<SurveyImage>& images,
                              const FilterVisibilityOptions& options) {
  if (images.empty()) return MakeError(ErrorCode::kNoData, "the survey has no posed image");
  CAIRN_ASSIGN_OR_RETURN(const Eigen::Vector3d up, UpDirection(images, options));
  Stations stations;
  stations.world.floor_from_world = FloorFromUp(up);
  std::vector<FloorPose> poses;
  for (const SurveyImage& image : images)
    poses.push_back(FloorPoseOf(image.cam_from_world, stations.world.floor_from_world));

  std::optional<Lattice> lattice;
  if (options.survey != "driven") lattice = RecogniseLattice(poses, options);
  if (options.survey == "lattice" && !lattice) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "option survey = 'lattice', but the positions of the {} images do not lie on a square "
                     "grid (at least 4 places, 9 in 10 within {} of a spacing): use 'driven' or 'auto'",
                     images.size(), kOnGridRatio);
  }
  if (lattice) {
    MakeLatticeStations(images, poses, *lattice, &stations);
  } else {
    MakeDrivenStations(images, poses, options, &stations);
  }
  return stations;
}

}  // namespace cairn::filter_visibility
