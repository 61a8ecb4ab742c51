#include "pipeline/program/program_parser.h"

#include "core/line/program_version.h"
#include "pipeline/program/help_formatter.h"

namespace cairn::pipeline {
namespace {

constexpr char kCommonHeading[] = "Common options";

void AddCommonArguments(CLI::App& app, CommonArguments* arguments) {
  ArgumentParser parser(app);
  parser.Add("--threads", arguments->num_threads, "Threads to use; 0 = all cores [0]")
      .NonNegative()
      .Type("N")
      .Group(kCommonHeading);
  parser.Add("--seed", arguments->seed, "Seed of everything random; same seed, same bytes [0]")
      .Type("S")
      .Group(kCommonHeading);
  parser
      .Add("--memory", arguments->memory_mib,
           "Maximum memory to use, MiB [4/5 of the machine's or the control group's]")
      .Range(1.0, 0x1p40)
      .Type("MIB")
      .Group(kCommonHeading);
  parser.Add("--progress", arguments->progress, "auto|bar|lines|json|none; auto: a bar on a terminal [auto]")
      .OneOf({"auto", "bar", "lines", "json", "none"})
      .Type("STYLE")
      .Group(kCommonHeading);
  parser.Add("--log-level", arguments->log_level, "trace|debug|info|warning|error|off [info]")
      .OneOf({"trace", "debug", "info", "warning", "error", "off"})
      .Type("LEVEL")
      .OnlyInHelpAll();
  parser
      .Add("--report", arguments->report_file,
           "Also write counts, rejects, times and memory of this run (docs/build_report.md)")
      .Type("FILE.json")
      .OnlyInHelpAll();
  parser
      .Add("--stamp", arguments->stamp,
           "For Makefiles: lock FOLDER, write FOLDER/NAME.report.json and the stamp there, dated when the "
           "command began; a failure writes FOLDER/error.json")
      .Type("FOLDER/NAME.stamp")
      .OnlyInHelpAll();
  app.set_version_flag("--version", std::string("cairn ") + ProgramVersion())->group(kMoreOptionsHeading);
}

void AddCommand(const Command& command, CLI::App& parent, CommonArguments* arguments) {
  CLI::App* const app = parent.add_subcommand(command.name, command.summary);
  app->group(command.heading);
  if (command.subcommands.empty()) {
    ArgumentParser parser(*app);
    command.add_arguments(parser);
    AddCommonArguments(*app, arguments);
    return;
  }
  app->require_subcommand(1);
  for (const Command& subcommand : command.subcommands) AddCommand(subcommand, *app, arguments);
}

void AddCalledCommands(const CLI::App& app, const std::string& words, std::vector<CalledCommand>* called) {
  const std::vector<const CLI::App*> subcommands = app.get_subcommands(nullptr);
  for (const CLI::App* subcommand : subcommands)
    AddCalledCommands(*subcommand, words + (words.empty() ? "" : " ") + subcommand->get_name(), called);
  if (subcommands.empty()) called->push_back({words, &app});
}

}  // namespace

std::unique_ptr<CLI::App> MakeParser(const std::vector<Command>& commands, CommonArguments* arguments) {
  auto app = std::make_unique<CLI::App>(
      "cairn compiles survey captures into landmark maps: survey images in, one small map file out.",
      "cairn");
  app->formatter(std::make_shared<HelpFormatter>());
  app->set_help_all_flag("--help-all", "Print this help with all options and exit");
  app->require_subcommand(1);
  app->set_version_flag("--version", std::string("cairn ") + ProgramVersion());
  for (const Command& command : commands) AddCommand(command, *app, arguments);
  return app;
}

ChosenCommand FindChosen(const CLI::App& parser, const std::vector<Command>& commands) {
  ChosenCommand chosen = {.arguments = &parser};
  const std::vector<Command>* candidates = &commands;
  while (!chosen.arguments->get_subcommands().empty()) {
    chosen.arguments = chosen.arguments->get_subcommands().front();
    const std::string name = chosen.arguments->get_name();
    chosen.words += (chosen.words.empty() ? "" : " ") + name;
    const Command& command = *std::find_if(candidates->begin(), candidates->end(),
                                           [&](const Command& candidate) { return candidate.name == name; });
    if (command.subcommands.empty()) chosen.command = &command;
    candidates = &command.subcommands;
  }
  return chosen;
}

std::vector<CalledCommand> CalledCommands(const CLI::App& parser) {
  std::vector<CalledCommand> called;
  AddCalledCommands(parser, "", &called);
  return called;
}

}  // namespace cairn::pipeline
