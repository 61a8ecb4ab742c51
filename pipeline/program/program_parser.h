#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/line/command.h"

namespace cairn::pipeline {

// What every command takes besides its own arguments.
struct CommonArguments {
  int num_threads = 0;
  uint64_t seed = 0;
  std::string progress = "auto";
  std::string log_level = "info";
  int64_t memory_mib = 0;
  std::string report_file;
  std::string stamp;
};

// The parser of the whole program: a subcommand per command.  `arguments` and what the commands hold
// outlive it.
std::unique_ptr<CLI::App> MakeParser(const std::vector<Command>& commands, CommonArguments* arguments);

// The command that the parsed words chose.
struct ChosenCommand {
  const Command* command = nullptr;     // null: the words end, or go wrong, before one that runs
  const CLI::App* arguments = nullptr;  // of the last word that is a command; never null
  std::string words;                    // "plan locate"
};

ChosenCommand FindChosen(const CLI::App& parser, const std::vector<Command>& commands);

// A command that runs, as it is called: {"plan locate", its parser}.
struct CalledCommand {
  std::string words;
  const CLI::App* arguments = nullptr;
};

// All commands that run, in the order of --help.
std::vector<CalledCommand> CalledCommands(const CLI::App& parser);

}  // namespace cairn::pipeline
