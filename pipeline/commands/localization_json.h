#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "runtime/localize/localization.h"

namespace cairn::pipeline {

// Of a cam_from_world: its rotation and translation, where the camera stands, and the covariance.
nlohmann::ordered_json PoseJson(const Pose& cam_from_world, const Matrix6d& covariance);

// What `cairn localize` says of a fix, or of the reason for none.
nlohmann::ordered_json LocalizationJson(const Localization& found);

// And of an image that could not be tried.
nlohmann::ordered_json ErrorJson(const std::string& image, const Error& error);

}  // namespace cairn::pipeline
