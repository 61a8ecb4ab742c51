#pragma once

#include <cstdint>

#include <CLI/CLI.hpp>

namespace cairn::pipeline {

// Gives a subcommand an option for an epoch of maps, at least `least`.  What is no such number is refused:
// CLI11 itself reads -1 as the largest one.
CLI::Option* AddEpochArgument(CLI::App& app, const char* name, uint64_t* epoch, uint64_t least,
                              const char* help);

}  // namespace cairn::pipeline
