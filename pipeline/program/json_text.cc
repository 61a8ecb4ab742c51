#include "pipeline/program/json_text.h"

#include <nlohmann/json.hpp>

namespace cairn::pipeline {

std::string JsonText(const nlohmann::ordered_json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace cairn::pipeline
