#pragma once

#include <functional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "core/line/command.h"
#include "pipeline/program/program.h"

namespace cairn::pipeline {

// What the program did with the words of a command line.
struct Outcome {
  int exit_code = 0;
  std::string out, err;
};

inline Outcome RunWords(const std::vector<Command>& commands, const std::vector<std::string>& words) {
  std::vector<const char*> argv = {"cairn"};
  for (const std::string& word : words) argv.push_back(word.c_str());
  std::ostringstream out, err;
  const int exit_code = RunProgram(commands, static_cast<int>(argv.size()), argv.data(), out, err);
  return {exit_code, out.str(), err.str()};
}

// Runs the program with one command, `stage`, that does `run`.
inline Outcome RunStage(const std::vector<std::string>& words,
                        std::function<Status(const CommandEnvironment&)> run) {
  return RunWords({{.name = "stage",
                    .summary = "Does what the test says",
                    .add_arguments = [](ArgumentParser&) {},
                    .run = std::move(run)}},
                  words);
}

inline Status Nothing(const CommandEnvironment&) { return Ok(); }

}  // namespace cairn::pipeline
