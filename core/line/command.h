#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/line/arguments.h"
#include "core/line/stage_report.h"
#include "core/options/options.h"

namespace cairn {

// What every command gets from the program: --threads, --memory, --seed, --progress, and where results go.
struct CommandEnvironment {
  int num_threads = 0;  // 0: all cores
  uint64_t seed = 0;
  bool seed_given = false;              // --seed is on the command line
  std::string progress_style = "auto";  // --progress and --log-level as given, for commands that start others
  std::string log_level = "info";
  int64_t memory_mib = 0;         // memory limit: --memory, or most of the machine's; > 0 when a command runs
  bool memory_given = false;      // --memory is on the command line
  Progress* progress = nullptr;   // never null when a command runs
  StageReport* report = nullptr;  // likewise: what the command reports about its run, for --report
  std::ostream* out = nullptr;    // results; messages go to spdlog (stderr)
};

// A command of `cairn`: argv and files only; the work is a library call.
struct Command {
  std::string name;     // one word: "filter-visibility" of `cairn stage filter-visibility`
  std::string summary;  // one line for --help
  // Adds positionals and options to the command's parser; called once, before parsing.
  std::function<void(ArgumentParser&)> add_arguments;
  // Runs after parsing.  An error's code is the program's exit code.
  std::function<Status(const CommandEnvironment&)> run;
  // Arguments that may have the output's name; the program refuses this for all others.  They are earlier
  // results that are taken over, words that name no file, and arguments that the command checks itself.
  std::vector<std::string> may_be_output = {};
  // Its name in recipes' tables and build reports; "": `name` with '_'.
  std::string stage = {};
  // Commands that begin with this word: then it has no arguments and does nothing itself.
  std::vector<Command> subcommands = {};
  // Its former names, or its names elsewhere: a user who types one is told this name.
  std::vector<std::string> former_names = {};
  // Its heading in `cairn --help`; "": it is not listed there.
  std::string heading = "Commands";
};

// Gives a command one `--name-with-dashes VALUE` per option of the table (help with default and range), and
// `--options FILE.toml`.  Apply() reads the file first, then the command line's values, then checks ranges.
class OptionArguments {
 public:
  // `table` points into an options struct that outlives this object.  `shown`: names of those that --help
  // lists, while --help-all lists the others too; empty: all are listed.
  void Add(ArgumentParser& parser, OptionTable table, const std::vector<std::string>& shown = {});
  // Errors: those of ReadOptionsFile, SetOption and CheckOptions; InvalidArgument for an option on the
  // command line that has no effect with the other values (CheckIsRead); in the file it may be meant for
  // other runs.
  Status Apply() const;
  // Refuses options of these names on the command line.  Errors: InvalidArgument: "--NAME: `reason`".
  Status RefuseGiven(const std::vector<std::string>& names, const std::string& reason) const;

 private:
  OptionTable table_;
  std::string options_file_;
  std::vector<std::string> texts_;
  std::vector<Argument> arguments_;
};

}  // namespace cairn
