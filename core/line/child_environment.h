#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cairn {

// Programs that cairn starts (make, colmap, itself through make) get an environment that cairn makes: make
// treats every variable of its environment as one of its Makefile's, and shells run what some of them name.
// Only what follows is passed on: where programs, libraries, home and temporary files are; language, time
// zone and terminal; how many threads and which devices numerical libraries use; what sanitizers are told;
// and what a cluster's scheduler and its authentication need.

// Whether this variable of cairn's environment is passed on.
bool IsPassedOn(std::string_view variable);

// The environment of a program to start: `added` ("NAME=VALUE" each), and the variables of this process that
// are passed on and not in `added`.
std::vector<std::string> ChildEnvironment(const std::vector<std::string>& added);

}  // namespace cairn
