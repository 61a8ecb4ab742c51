#pragma once

#include <optional>

#include <nlohmann/json.hpp>

#include "runtime/visual_map/visual_disagreement.h"
#include "runtime/visual_map/visual_tracker.h"

namespace cairn::pipeline {

// What the visual map says of an image, and what PnP's answer has to do with it, as JSON.
nlohmann::ordered_json VisualJson(const VisualPose& pose);
// With what it was found by.
nlohmann::ordered_json TrackedJson(const TrackedVisualPose& found);
nlohmann::ordered_json DisagreementJson(const Disagreement& disagreement);

}  // namespace cairn::pipeline
