#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/line/command.h"

namespace cairn::pipeline {

// What every subcommand takes beside its own arguments.
struct CommonArguments {
  int num_threads = 0;
  uint64_t seed = 0;
  std::string progress = "auto";
  std::string log_level = "info";
  int64_t memory_mib = 0;
  std::string report_file;
  std::string stamp;
};

// The parser of the whole program: one subcommand per command.  `arguments` and what the commands hold
// outlive it.
std::unique_ptr<CLI::App> MakeParser(const std::vector<Command>& commands, CommonArguments* arguments);

}  // namespace cairn::pipeline
