#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// A place in a question: floor frame, metres; heading counter-clockwise from +x.
struct AskedPlace {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  std::optional<double> heading_deg;
};

// The stations that answer for a place: of the nearest place of the survey, the one whose heading is nearest,
// or, without a heading, all of them.  Ascending.  Errors: NotFound when no station lies within two spacings
// of stations (says how far the nearest one is, and what the survey spans); NoData without stations.
Result<std::vector<StationIdx>> StationsAt(const MapRows& rows, const AskedPlace& place);

// Why a station is covered or not: regions, landmarks, images, what each stage dropped there and why, how its
// regions fared in the self-test, what looks like it.
std::string ExplainStationText(const MapRows& rows, StationIdx station);
nlohmann::ordered_json ExplainStationJson(const MapRows& rows, StationIdx station);

// A line per station, for several headings of one place.
std::string StationSummaryText(const MapRows& rows, const std::vector<StationIdx>& stations);

// A survey image: where it was taken, what it sees, whether the appearance graph keeps it.
// REQUIRES: image in range
std::string ExplainImageText(const MapRows& rows, int32_t image);
nlohmann::ordered_json ExplainImageJson(const MapRows& rows, int32_t image);

}  // namespace cairn::pipeline
