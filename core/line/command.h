#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/line/stage_report.h"
#include "core/options/options.h"

namespace cairn {

// What every subcommand gets from the program: --threads, --memory, --seed, --progress, and where results go.
struct CommandEnvironment {
  int num_threads = 0;  // 0 = all cores
  uint64_t seed = 0;
  bool seed_given = false;              // --seed is on the command line
  std::string progress_style = "auto";  // --progress and --log-level as given, for commands that start others
  std::string log_level = "info";
  int64_t memory_mib = 0;  // most memory to take: --memory, or most of the machine's; > 0 when a command runs
  bool memory_given = false;      // --memory is on the command line
  Progress* progress = nullptr;   // never null when a command runs
  StageReport* report = nullptr;  // likewise: what the command tells about its run, for --report
  std::ostream* out = nullptr;    // results; messages go to spdlog (stderr)
};

// A subcommand of `cairn`: argv and files only; the work is a library call.
struct Command {
  std::string name;     // "filter-visibility"
  std::string summary;  // one line for --help
  // Adds positionals and options to the subcommand's parser; called once, before parsing.
  std::function<void(CLI::App&)> add_arguments;
  // Runs after parsing.  An error's code is the program's exit code.
  std::function<Status(const CommandEnvironment&)> run;
  // Arguments that may have the output's name, which the program refuses to all others: earlier results that
  // are taken over, words that name no file, what the command checks itself.
  std::vector<std::string> may_be_output = {};
};

// Gives a subcommand one `--name-with-dashes VALUE` per option of the table (help with default and range),
// and
// `--options FILE.toml`.  Apply() reads the file first, then the command line's values, then checks ranges.
class OptionArguments {
 public:
  // `table` points into an options struct that outlives this object.
  void Add(CLI::App& app, OptionTable table);
  // Errors: those of ReadOptionsFile, SetOption and CheckOptions; InvalidArgument for an option of the
  // command line that nothing reads beside the others (CheckIsRead): one in the file may be meant for other
  // runs.
  Status Apply() const;
  // Refuses options of these names that are on the command line.  Errors: InvalidArgument: "--NAME:
  // `reason`".
  Status RefuseGiven(const std::vector<std::string>& names, const std::string& reason) const;

 private:
  OptionTable table_;
  std::string options_file_;
  std::vector<std::string> texts_;
  std::vector<const CLI::Option*> arguments_;
};

}  // namespace cairn
