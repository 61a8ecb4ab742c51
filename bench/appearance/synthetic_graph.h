#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/world/appearance_graph.h"

namespace cairn {

// Places spread evenly over a square and linked up to a distance that gives about `degree` neighbours, as
// images of one floor are; inliers fall with the distance.  Numbered as a robot takes them that sweeps the
// floor in lanes as wide as that distance, to and fro, or at random.  O(links).
inline AppearanceGraph SyntheticGraph(int num_nodes, double degree, uint64_t seed, bool is_swept = true) {
  Random random(seed);
  std::vector<std::pair<double, double>> places;
  for (int i = 0; i < num_nodes; ++i) {
    const double x = random.Uniform();
    places.emplace_back(x, random.Uniform());
  }
  const double radius = std::sqrt(degree / (num_nodes * std::numbers::pi));
  if (is_swept) {
    const auto way = [&](const std::pair<double, double>& place) {
      const int lane = static_cast<int>(place.second / radius);
      return std::pair(lane, lane % 2 == 0 ? place.first : -place.first);
    };
    std::sort(places.begin(), places.end(), [&](const auto& a, const auto& b) { return way(a) < way(b); });
  }
  const int num_cells = std::max(1, static_cast<int>(1 / radius));
  const auto cell_of = [&](double x) { return std::min(num_cells - 1, static_cast<int>(x * num_cells)); };
  std::vector<std::vector<int>> cells(static_cast<size_t>(num_cells) * num_cells);
  std::vector<AppearanceLink> links;
  for (int i = 0; i < num_nodes; ++i) {
    const auto [x, y] = places[i];
    for (int row = std::max(0, cell_of(y) - 1); row <= std::min(num_cells - 1, cell_of(y) + 1); ++row) {
      for (int column = std::max(0, cell_of(x) - 1); column <= std::min(num_cells - 1, cell_of(x) + 1);
           ++column) {
        for (const int j : cells[static_cast<size_t>(row) * num_cells + column]) {
          const double distance = std::hypot(x - places[j].first, y - places[j].second);
          if (distance < radius)
            links.push_back({j, i, 15 + static_cast<int>(300 * (1 - distance / radius))});
        }
      }
    }
    cells[static_cast<size_t>(cell_of(y)) * num_cells + cell_of(x)].push_back(i);
  }
  return AppearanceGraph(num_nodes, std::move(links));
}

// The graph's largest component.
inline AppearanceGraph LargestComponent(const AppearanceGraph& graph) {
  std::vector<NodeIdx> largest;
  for (const std::vector<NodeIdx>& nodes : FindComponents(graph).nodes) {
    if (nodes.size() > largest.size()) largest = nodes;
  }
  return InducedSubgraph(graph, largest);
}

}  // namespace cairn
