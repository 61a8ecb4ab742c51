#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/options/options.h"

namespace cairn::pipeline {

// The options of one stage as a recipe sees them: a table that points into a struct which this object
// keeps alive.
struct StageOptions {
  std::string stage;  // "extract_features": the stage's folder, command and table in a recipe
  OptionTable table;
  std::shared_ptr<void> options;
};

// Wraps a stage's options struct, with its defaults.
template <typename Options>
StageOptions MakeStageOptions(const std::string& stage) {
  auto options = std::make_shared<Options>();
  return {.stage = stage, .table = DescribeOptions(options.get()), .options = options};
}

// Every stage that a recipe can have a table for, with defaults, in the order of the line.
std::vector<StageOptions> AllStageOptions();

}  // namespace cairn::pipeline
