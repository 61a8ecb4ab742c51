#include "pipeline/commands/commands.h"

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "core/files/file.h"
#include "core/line/program_version.h"
#include "pipeline/program/common_arguments.h"
#include "pipeline/program/manual.h"

namespace cairn::pipeline {
namespace {

Status WriteManual(const std::string& folder) {
  const std::string pages = folder + "/man1";
  std::error_code error;
  std::filesystem::create_directories(pages, error);
  if (error) return MakeError(ErrorCode::kIo, "{}: cannot make the folder: {}", pages, error.message());
  CommonArguments arguments;
  const std::vector<Command> commands = AllCommands();
  const std::unique_ptr<CLI::App> program = MakeParser(commands, &arguments);
  for (const CLI::App* command : program->get_subcommands(nullptr)) {
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(pages + "/cairn-" + command->get_name() + ".1",
                                              CommandPage(*program, *command, ProgramVersion())));
  }
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/cairn.bash", BashCompletion(*program)));
  return WriteFileAtomically(pages + "/cairn.1", ProgramPage(*program, ProgramVersion()));
}

}  // namespace

Command ManualCommand() {
  auto folder = std::make_shared<std::string>();
  return {
      .name = "manual",
      .summary = "Writes this program's manual pages and its completion for bash into a folder",
      .add_arguments =
          [folder](CLI::App& app) {
            app.add_option("-o,--output", *folder, "Folder: man1/*.1 and cairn.bash")
                ->required()
                ->type_name("FOLDER");
          },
      .run = [folder](const CommandEnvironment&) { return WriteManual(*folder); },
  };
}

}  // namespace cairn::pipeline
