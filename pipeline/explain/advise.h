#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/blocks/map_rows.h"
#include "pipeline/explain/pareto_points.h"

namespace cairn::pipeline {

// What would make a map better, in plain words, most important first: uncovered places with the reason and
// the images to take next, places that look like others, regions where held-out images were not localized,
// places that the last survey found poorer, options worth changing.
struct Advice {
  struct View {
    Eigen::Vector2d position = Eigen::Vector2d::Zero();  // floor frame, metres
    std::optional<double> heading_deg;
  };
  std::string text;                  // one or two sentences
  std::vector<StationIdx> stations;  // that it is about, ascending; none: the map as a whole
  std::optional<RegionIdx> region;   // that it is about
  std::vector<View> images_to_take;  // at most kMaxViews
  bool is_weakness = true;           // false: nothing shows that the map is weak there
  static constexpr size_t kMaxViews = 8;
};

// A region that localizes a smaller part of its held-out images is a poor one.
inline constexpr double kPoorLocalizedRatio = 0.8;

// About these stations (ascending) and what concerns the map as a whole; empty: about all stations.
// Needs what the compilation found out (MapFindings): without it, says so.
std::vector<Advice> Advise(const MapRows& rows, const std::vector<StationIdx>& about = {});

// Adds advice from maps of other sizes of the same place: whether a smaller one is enough, or a larger one
// localizes more, before advice on places.  `num_bytes` is the map's.
void AddSizes(const MapRows& rows, int64_t num_bytes, const std::vector<ParetoPoint>& sizes,
              std::vector<Advice>* advice);

// A held-out image that was not localized, or at a wrong place: where it was taken.
struct FailedImage {
  std::string name;
  std::optional<StationIdx> station;
  Advice::View view;
};
// Adds images to take where held-out images failed: first in the advice about their places, or in advice
// of their own where there is none.
void AddFailedImages(const MapHead& head, const std::vector<FailedImage>& failed,
                     std::vector<Advice>* advice);

// Where held-out images were taken, and where the map puts them, floor frame, metres.
struct PlacedImage {
  Eigen::Vector2d taken = Eigen::Vector2d::Zero();
  Eigen::Vector2d found = Eigen::Vector2d::Zero();
};
// Adds advice if one rotation, scale and shift removes most of their errors: then the frames differ.
void AddMisalignment(const std::vector<PlacedImage>& images, std::vector<Advice>* advice);

// A numbered line per advice, with the places of images to take under it.
std::string AdviceText(const std::vector<Advice>& advice);

}  // namespace cairn::pipeline
