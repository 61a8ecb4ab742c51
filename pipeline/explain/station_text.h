#pragma once

#include <string>

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// "2.00, 1.25, 90 deg": where a station is, floor frame, metres.
std::string PlaceText(const MapStation& station);

// "station 57 (2.00, 1.25, 90 deg)".
std::string StationText(const MapRows& rows, StationIdx station);

}  // namespace cairn::pipeline
