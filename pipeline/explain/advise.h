#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/map_rows.h"

namespace cairn {

// What would make a map better, in plain words, most important first: uncovered places with the reason and
// the images to take next, places that look like others, regions where held-out images were not localized,
// options worth changing.
struct Advice {
  struct View {
    Eigen::Vector2d position = Eigen::Vector2d::Zero();  // floor frame, metres
    std::optional<double> heading_deg;
  };
  std::string text;                  // one or two sentences
  std::vector<StationIdx> stations;  // that it is about, ascending; none: the map as a whole
  std::vector<View> images_to_take;  // at most kMaxViews
  static constexpr size_t kMaxViews = 8;
};

// About these stations (ascending) and what concerns the map as a whole; empty: about all stations.
// Needs what the compilation found out (MapFindings): without it, says so.
std::vector<Advice> Advise(const MapRows& rows, const std::vector<StationIdx>& about = {});

// A numbered line per advice, with the places of images to take under it.
std::string AdviceText(const std::vector<Advice>& advice);

}  // namespace cairn
