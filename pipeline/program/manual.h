#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace cairn::pipeline {

// The program's documentation from its parser, which --help is printed from too.

// Manual page (roff) of the whole program: its subcommands and exit codes.
std::string ProgramPage(const CLI::App& program, const std::string& version);
// Of one subcommand: its arguments and options by group.
std::string CommandPage(const CLI::App& program, const CLI::App& command, const std::string& version);

// A script for bash that completes subcommands and options, and elsewhere the names of files.
std::string BashCompletion(const CLI::App& program);

}  // namespace cairn::pipeline
