#include "pipeline/program/program.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>
#include <iostream>
#include <optional>
#include <sstream>
#include <utility>

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "core/base/no_throw.h"
#include "core/base/parallel.h"
#include "core/base/printable.h"
#include "core/files/file.h"
#include "core/line/memory.h"
#include "core/options/options.h"
#include "pipeline/build/build_step.h"
#include "pipeline/program/check_outputs.h"
#include "pipeline/program/printable_stream.h"
#include "pipeline/program/program_parser.h"
#include "pipeline/program/progress.h"
#include "pipeline/program/stop_signal.h"

namespace cairn::pipeline {
namespace {

constexpr int kUsageExitCode = 2;
const Error kStopped = {ErrorCode::kCancelled, "stopped on request"};

std::unique_ptr<Progress> MakeTerminalProgress(ProgressStyle style) {
  return MakeProgress(
      style, {.write = [](const std::string& text) { std::cerr << text << std::flush; },
              .seconds =
                  [] {
                    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
                        .count();
                  },
              .cancelled = [] { return StopRequested(); }});
}

// A message as a terminal may show it.
class PrintableMessage : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& out) override {
    const std::string text = Printable({message.payload.data(), message.payload.size()});
    out.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PrintableMessage>();
  }
};

// Messages go to stderr, as does the bar: a message first clears the bar's line.
void ConfigureLog(const std::string& level, ProgressStyle style) {
  auto logger =
      std::make_shared<spdlog::logger>("cairn", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  logger->set_level(spdlog::level::from_str(level));
  auto formatter = std::make_unique<spdlog::pattern_formatter>();
  formatter->add_flag<PrintableMessage>('*').set_pattern(style == ProgressStyle::kBar ? "\r\x1b[K%^%l%$: %*"
                                                                                      : "%^%l%$: %*");
  logger->set_formatter(std::move(formatter));
  spdlog::set_default_logger(logger);
}

Error OutOfMemory(const CommandEnvironment& environment) {
  return MakeError(
      ErrorCode::kNoMemory,
      "out of memory, with --memory {} (MiB) and {} threads; give it more, or use fewer --threads",
      environment.memory_mib, NumThreads(environment.num_threads));
}

Status RunCaught(const Command& command, const CommandEnvironment& environment) {
  try {
    Status status = command.run(environment);
    if (!status.ok() && StopRequested()) return kStopped;
    if (!status.ok() && status.error().code == ErrorCode::kNoMemory &&
        status.error().message.ends_with("out of memory"))  // of a library, which does not know of --memory
      return OutOfMemory(environment);
    return status;
  } catch (const std::exception& exception) {
    if (IsOutOfMemory(exception)) return OutOfMemory(environment);
    return MakeError(ErrorCode::kFailed, "unexpected failure: {}; please report it with the command line",
                     exception.what());
  }
}

int Report(const ChosenCommand& chosen, const CommonArguments& arguments, const Error& error,
           std::ostream& err) {
  err << "cairn " << chosen.words << ": " << error.message << std::endl;
  if (!arguments.stamp.empty()) {
    const std::string folder = std::filesystem::absolute(arguments.stamp).parent_path().string();
    if (const Status status = WriteErrorFile(folder, chosen.command->name, error); !status.ok())
      spdlog::warn("{}", status.error().message);
  }
  return static_cast<int>(error.code);
}

// "match_features": what a stage's folder, its table in a recipe and its part of a report are called.
std::string StageName(const Command& command) {
  std::string name = command.stage.empty() ? command.name : command.stage;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

// Runs the command; what it printed and reported goes to the files that were asked for.
Status RunCommand(const ChosenCommand& chosen, const CommonArguments& arguments,
                  CommandEnvironment environment, std::ostream& out, std::ostream& err) {
  const auto begin = std::chrono::steady_clock::now();
  std::optional<BuildStep> step;
  if (!arguments.stamp.empty()) {
    CAIRN_ASSIGN_OR_RETURN(BuildStep begun, BuildStep::Begin(arguments.stamp));
    step.emplace(std::move(begun));
  }
  const std::string report_file =
      arguments.report_file.empty() && step ? step->ReportPath() : arguments.report_file;
  // Outputs in progress are left as after a kill.
  const StopDeadline deadline([&] {
    try {
      Report(chosen, arguments, kStopped, err);
    } catch (const std::exception&) {  // there is no memory to say so
    }
    std::_Exit(static_cast<int>(kStopped.code));
  });
  StageReport report;
  std::ostringstream printed;
  printed.exceptions(std::ios::badbit);  // only for lack of memory
  environment.report = &report;
  environment.out = report_file.empty() ? &out : &printed;
  Status status = RunCaught(*chosen.command, environment);
  if (!report_file.empty()) {
    out << printed.str();
    if (!status.ok()) return status;
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    const nlohmann::ordered_json run = StageRunJson({.stage = StageName(*chosen.command),
                                                     .seconds = seconds.count(),
                                                     .num_threads = environment.num_threads,
                                                     .memory_mib = environment.memory_mib,
                                                     .seed = environment.seed,
                                                     .printed = printed.str(),
                                                     .report = &report});
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(
        report_file, run.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n"));
  }
  if (status.ok() && step) status = step->End();
  return status;
}

std::string NearestText(const std::string& word, const std::vector<std::string>& candidates) {
  const std::string nearest = NearestWord(word, candidates);
  return nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest);
}

void AddNames(const std::vector<Command>& commands, const std::string& before,
              std::vector<std::pair<std::string, std::string>>* names) {
  for (const Command& command : commands) {
    const std::string words = before + command.name;
    names->emplace_back(command.name, words);
    for (const std::string& name : command.former_names) names->emplace_back(name, words);
    AddNames(command.subcommands, words + " ", names);
  }
}

// The command whose name, whatever words stand before it, is nearest to the word.
std::string NearestCommandText(const std::string& word, const std::vector<Command>& commands) {
  std::vector<std::pair<std::string, std::string>> names;  // and how it is called
  AddNames(commands, "", &names);
  std::vector<std::string> candidates;
  for (const auto& [name, called] : names) candidates.push_back(name);
  const std::string nearest = NearestWord(word, candidates);
  const auto found =
      std::find_if(names.begin(), names.end(), [&](const auto& n) { return n.first == nearest; });
  return nearest.empty() ? "" : fmt::format("; did you mean '{}'?", found->second);
}

// What is wrong with a word that no command and no option takes; empty where there is none.
std::string UnknownWordText(const ChosenCommand& chosen, const std::vector<Command>& commands,
                            const std::vector<std::string>& words) {
  if (chosen.command == nullptr) {
    const auto num_words =
        chosen.words.empty() ? 0 : std::count(chosen.words.begin(), chosen.words.end(), ' ') + 1;
    if (std::cmp_less_equal(words.size(), num_words)) return "give a command";
    if (words[num_words].starts_with('-')) return "";
    const std::string& word = words[num_words];
    return fmt::format("no command '{}'{}", chosen.words.empty() ? word : chosen.words + " " + word,
                       NearestCommandText(word, commands));
  }
  for (const std::string& word : chosen.arguments->remaining()) {
    if (word == "--" || !word.starts_with('-')) continue;
    const std::string option = word.substr(0, word.find('='));
    std::vector<std::string> names;
    for (const CLI::Option* known : chosen.arguments->get_options()) {
      for (const std::string& name : known->get_lnames()) names.push_back("--" + name);
    }
    return fmt::format("no option '{}'{}", option, NearestText(option, names));
  }
  return "";
}

// Usage errors as one line that says where help is.
int ReportUsage(const CLI::App& app, const std::vector<Command>& commands,
                const std::vector<std::string>& words, const CLI::ParseError& error, std::ostream& err) {
  const ChosenCommand chosen = FindChosen(app, commands);
  const std::string name = chosen.words.empty() ? "cairn" : "cairn " + chosen.words;
  const std::string unknown = UnknownWordText(chosen, commands, words);
  err << name << ": " << (unknown.empty() ? error.what() : unknown) << "; see " << name << " --help"
      << std::endl;
  return kUsageExitCode;
}

}  // namespace

int RunProgram(const std::vector<Command>& commands, int argc, const char* const* argv, std::ostream& raw_out,
               std::ostream& raw_err) {
  PrintableStream out(raw_out), err(raw_err);
  CommonArguments arguments;
  const std::unique_ptr<CLI::App> parser = MakeParser(commands, &arguments);
  CLI::App& app = *parser;
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    app.exit(success, out, err);
    return 0;
  } catch (const CLI::ParseError& error) {
    return ReportUsage(app, commands, std::vector<std::string>(argv + 1, argv + argc), error, err);
  }

  const ChosenCommand chosen = FindChosen(app, commands);
  const auto style = ParseProgressStyle(arguments.progress, isatty(STDERR_FILENO) != 0);
  if (!style.ok()) return Report(chosen, arguments, style.error(), err);
  ConfigureLog(arguments.log_level, *style);
  CatchStopSignals();
  const std::unique_ptr<Progress> progress = MakeTerminalProgress(*style);
  const CommandEnvironment environment = {
      .num_threads = arguments.num_threads,
      .seed = arguments.seed,
      .seed_given = chosen.arguments->count("--seed") > 0,
      .progress_style = arguments.progress,
      .log_level = arguments.log_level,
      .memory_mib = arguments.memory_mib > 0 ? arguments.memory_mib : DefaultMemoryMib(),
      .memory_given = arguments.memory_mib > 0,
      .progress = progress.get()};
  Status status = CheckOutputs(*chosen.arguments, chosen.command->may_be_output);
  if (status.ok()) status = RunCommand(chosen, arguments, environment, out, err);
  out.flush();
  if (status.ok() && out.lacked_memory())
    status = MakeError(ErrorCode::kNoMemory,
                       "the command is done and its files are written, but what it prints is not whole: out "
                       "of memory");
  if (status.ok() && !out)
    status = MakeError(ErrorCode::kIo,
                       "the command is done and its files are written, but standard output cannot be "
                       "written: is the disk full?");
  if (!status.ok()) return Report(chosen, arguments, status.error(), err);
  return 0;
}

}  // namespace cairn::pipeline
