#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace cairn::pipeline {

// JSON of names from files: bytes that are not UTF-8 become U+FFFD instead of an exception.  `indent` < 0:
// one line.
std::string JsonText(const nlohmann::ordered_json& json, int indent = -1);

}  // namespace cairn::pipeline
