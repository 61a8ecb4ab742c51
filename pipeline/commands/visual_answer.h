#pragma once

#include <optional>

#include <nlohmann/json.hpp>

#include "runtime/visual_map/visual_disagreement.h"

namespace cairn::pipeline {

// What the visual map says of an image, and what PnP's answer has to do with it, as JSON.
nlohmann::ordered_json VisualJson(const VisualPose& pose);
nlohmann::ordered_json DisagreementJson(const Disagreement& disagreement);

}  // namespace cairn::pipeline
