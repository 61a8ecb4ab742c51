#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "runtime/localize/localization.h"

namespace cairn::pipeline {

// What `cairn localize` says of a fix, or of the reason for none.
nlohmann::ordered_json LocalizationJson(const Localization& found);

// And of an image that could not be tried.
nlohmann::ordered_json ErrorJson(const std::string& image, const Error& error);

}  // namespace cairn::pipeline
