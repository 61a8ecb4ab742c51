#pragma once

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "stages/decompose_views/decompose_views.h"

namespace cairn::decompose_views {

inline InputPlan Parsed(const std::string& text) {
  auto input = ParsePlan(text, "plan");
  EXPECT_TRUE(input.ok()) << input.error().message;
  return input.ok() ? *input : InputPlan{};
}

inline DecomposeViewsResult Decomposed(const std::string& text, const DecomposeViewsOptions& options = {},
                                       int num_threads = 1) {
  NoProgress progress;
  auto result = DecomposeViews(Parsed(text), options, num_threads, 4096, progress);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return result.ok() ? std::move(*result) : DecomposeViewsResult{};
}

// GeoJSON of one polygon with holes.
using Corners = std::vector<std::pair<double, double>>;
inline std::string PolygonText(const std::vector<Corners>& rings) {
  std::string text = "{\"type\": \"Polygon\", \"coordinates\": [";
  for (size_t i = 0; i < rings.size(); ++i) {
    text += i > 0 ? ",[" : "[";
    for (const auto& [x, y] : rings[i]) text += fmt::format("[{},{}],", x, y);
    text += fmt::format("[{},{}]]", rings[i][0].first, rings[i][0].second);
  }
  return text + "]}";
}

// Rounding far below a hair's breadth of tests/runtime/paths/plan_oracle.h.
inline DecomposeViewsOptions FineGrid() {
  DecomposeViewsOptions options;
  options.clean.grid_m = 1e-6;
  return options;
}

}  // namespace cairn::decompose_views
