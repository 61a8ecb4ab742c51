#include "pipeline/program/common_arguments.h"

#include "core/line/program_version.h"

namespace cairn::pipeline {
namespace {

void AddCommonArguments(CLI::App& app, CommonArguments* arguments) {
  app.add_option("--threads", arguments->num_threads, "Threads to use; 0 = all cores [0]")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N")
      ->group("Common options");
  app.add_option("--seed", arguments->seed, "Seed of everything random; same seed, same bytes [0]")
      ->type_name("S")
      ->group("Common options");
  app.add_option("--progress", arguments->progress,
                 "auto|bar|lines|json|none; auto: a bar on a terminal [auto]")
      ->check(CLI::IsMember({"auto", "bar", "lines", "json", "none"}))
      ->type_name("STYLE")
      ->group("Common options");
  app.add_option("--log-level", arguments->log_level, "trace|debug|info|warning|error|off [info]")
      ->check(CLI::IsMember({"trace", "debug", "info", "warning", "error", "off"}))
      ->type_name("LEVEL")
      ->group("Common options");
  app.add_option("--memory", arguments->memory_mib,
                 "Most memory to use, MiB [4/5 of the machine's or the control group's]")
      ->check(CLI::Range(int64_t{1}, int64_t{1} << 40))
      ->type_name("MIB")
      ->group("Common options");
  app.add_option("--report", arguments->report_file,
                 "Also write counts, rejects, times and memory of this run (docs/build_report.md)")
      ->type_name("FILE.json")
      ->group("Common options");
  app.add_option(
         "--stamp", arguments->stamp,
         "For Makefiles: hold DIR, leave DIR/NAME.report.json and the stamp there, dated when the command "
         "began; a failure leaves DIR/error.json")
      ->type_name("DIR/NAME.stamp")
      ->group("Common options");
  app.set_version_flag("--version", std::string("cairn ") + ProgramVersion());
}

}  // namespace

std::unique_ptr<CLI::App> MakeParser(const std::vector<Command>& commands, CommonArguments* arguments) {
  auto app = std::make_unique<CLI::App>(
      "cairn compiles survey captures into landmark maps: survey images in, one small map file out.",
      "cairn");
  app->require_subcommand(1);
  app->set_version_flag("--version", std::string("cairn ") + ProgramVersion());
  for (const Command& command : commands) {
    CLI::App* subcommand = app->add_subcommand(command.name, command.summary);
    command.add_arguments(*subcommand);
    AddCommonArguments(*subcommand, arguments);
  }
  return app;
}

}  // namespace cairn::pipeline
