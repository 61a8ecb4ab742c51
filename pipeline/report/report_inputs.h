#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// Whether they have what a page shows of them, with the right types and possible numbers.
bool IsBuildReport(const nlohmann::ordered_json& build);
bool IsCheckReport(const nlohmann::ordered_json& check);
// Whether a check was of this map: of as many landmarks and regions; of a sealed map, with its figures.
// REQUIRES: IsCheckReport
bool IsCheckOf(const nlohmann::ordered_json& check, const MapRows& rows);
bool IsDrive(const nlohmann::ordered_json& drive);

}  // namespace cairn::pipeline
