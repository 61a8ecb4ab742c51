#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/world/world.h"
#include "stages/decompose_regions/decompose_regions.h"

namespace cairn::decompose_regions {

// A lattice world from a drawing, one metre a cell: a letter or digit is a station, a blank or '.' none;
// stations are numbered row by row, from the first row.  Features are drawings of the same shape in which '#'
// sees the feature.
inline World AsciiWorld(const std::vector<std::string>& stations,
                        const std::vector<std::vector<std::string>>& features) {
  World world;
  std::map<std::pair<int, int>, StationIdx> station_at;
  for (int row = 0; row < static_cast<int>(stations.size()); ++row) {
    for (int column = 0; column < static_cast<int>(stations[row].size()); ++column) {
      if (stations[row][column] == '.' || stations[row][column] == ' ') continue;
      const StationIdx station = world.num_stations();
      station_at[{row, column}] = station;
      world.positions.emplace_back(column, -row);
      for (const auto& other : {std::pair(row - 1, column), std::pair(row, column - 1)}) {
        if (station_at.count(other)) world.edges.emplace_back(station_at[other], station);
      }
    }
  }
  std::sort(world.edges.begin(), world.edges.end());
  for (const std::vector<std::string>& drawing : features) {
    std::vector<StationIdx>& area = world.areas.emplace_back();
    for (const auto& [place, station] : station_at) {
      if (drawing[place.first][place.second] == '#') area.push_back(station);
    }
  }
  return world;
}

// A lattice of width x height with some stations missing, and features that are discs, or, if `scattered`,
// any subset.
inline World RandomWorld(int width, int height, int num_features, bool scattered, uint64_t seed) {
  Random random(seed);
  std::vector<std::string> stations(height, std::string(width, 'o'));
  for (std::string& row : stations) {
    for (char& station : row) {
      if (random.Uniform() < 0.15) station = '.';
    }
  }
  std::vector<std::vector<std::string>> features;
  for (int f = 0; f < num_features; ++f) {
    const double x = random.Uniform(0, width), y = random.Uniform(0, height);
    const double radius = random.Uniform(0.15, 0.6) * std::max(width, height);
    std::vector<std::string>& drawing = features.emplace_back(height, std::string(width, '.'));
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) {
        const bool seen = scattered ? random.Uniform() < 0.8 : std::hypot(column - x, row - y) < radius;
        if (seen) drawing[row][column] = '#';
      }
    }
  }
  return AsciiWorld(stations, features);
}

// The decomposition of a world that has one.
inline Decomposition Decompose(const World& world, const DecomposeRegionsOptions& options,
                               uint64_t seed = 0) {
  const Result<Decomposition> result = DecomposeRegions(world, options, seed);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
  return result.ok() ? *result : Decomposition();
}

}  // namespace cairn::decompose_regions
