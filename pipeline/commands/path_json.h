#pragma once

#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

namespace cairn::pipeline {

// [[x, y], ...], metres.
inline nlohmann::ordered_json PathJson(const std::vector<Eigen::Vector2d>& points) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Eigen::Vector2d& point : points) list.push_back({point.x(), point.y()});
  return list;
}

}  // namespace cairn::pipeline
