#pragma once

#include <bit>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "stages/link_appearance/dominating_set/domination.h"

namespace cairn::link_appearance {

// A graph of links with 30 inliers each.
inline AppearanceGraph GraphOf(int num_nodes, const std::vector<std::pair<NodeIdx, NodeIdx>>& pairs) {
  std::vector<AppearanceLink> links;
  for (const auto& [a, b] : pairs) links.push_back({std::min(a, b), std::max(a, b), 30});
  return AppearanceGraph(num_nodes, std::move(links));
}

// 0 - 1 - 2 - ... - n-1, and back to 0 if it is closed.
inline AppearanceGraph PathGraph(int num_nodes, bool closed = false) {
  std::vector<std::pair<NodeIdx, NodeIdx>> pairs;
  for (int i = 1; i < num_nodes; ++i) pairs.emplace_back(i - 1, i);
  if (closed) pairs.emplace_back(0, num_nodes - 1);
  return GraphOf(num_nodes, pairs);
}

// Points in a square, linked when nearer than a radius that gives about `degree` neighbours; inliers fall
// with the distance.  May fall apart.
inline AppearanceGraph GeometricGraph(int num_nodes, double degree, uint64_t seed) {
  Random random(seed);
  std::vector<std::pair<double, double>> points;
  for (int i = 0; i < num_nodes; ++i) {
    const double x = random.Uniform();
    points.emplace_back(x, random.Uniform());
  }
  const double radius = std::sqrt(degree / (num_nodes * std::numbers::pi));
  std::vector<AppearanceLink> links;
  for (int i = 0; i < num_nodes; ++i) {
    for (int j = i + 1; j < num_nodes; ++j) {
      const double distance =
          std::hypot(points[i].first - points[j].first, points[i].second - points[j].second);
      if (distance < radius) links.push_back({i, j, 15 + static_cast<int>(200 * (1 - distance / radius))});
    }
  }
  return AppearanceGraph(num_nodes, std::move(links));
}

// Size of a smallest set that meets the demands and is connected, by trying all of them; -1: none.
inline int SmallestSize(const Domination& domination) {
  const int num_nodes = domination.graph().num_nodes();
  int smallest = -1;
  for (uint32_t bits = 1; bits < (1u << num_nodes); ++bits) {
    const int size = std::popcount(bits);
    if (smallest >= 0 && size >= smallest) continue;
    std::vector<char> kept(num_nodes);
    for (int i = 0; i < num_nodes; ++i) kept[i] = (bits >> i) & 1;
    if (domination.IsConnected(kept) && domination.Undominated(kept).empty()) smallest = size;
  }
  return smallest;
}

}  // namespace cairn::link_appearance
