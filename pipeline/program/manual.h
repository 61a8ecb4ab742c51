#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "pipeline/program/program_parser.h"

namespace cairn::pipeline {

// The program's documentation from its parser, which --help is printed from too.

// Manual page (roff) of the whole program: its commands and exit codes.
std::string ProgramPage(const CLI::App& program, const std::string& version);
// Of one command: its arguments and options by group.
std::string CommandPage(const CalledCommand& command, const std::string& version);
// "cairn-plan-locate": what its page is called.
std::string PageName(const CalledCommand& command);

// A script for bash that completes commands and options, and elsewhere the names of files.
std::string BashCompletion(const CLI::App& program);

}  // namespace cairn::pipeline
