#include "pipeline/commands/commands.h"

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "core/files/file.h"
#include "core/line/program_version.h"
#include "pipeline/build/recipe.h"
#include "pipeline/build/stage_options.h"
#include "pipeline/program/manual.h"
#include "pipeline/program/program_parser.h"

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
  for (const CalledCommand& command : CalledCommands(*program)) {
    CAIRN_RETURN_IF_ERROR(
        WriteFileAtomically(pages + "/" + PageName(command) + ".1", CommandPage(command, ProgramVersion())));
  }
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/recipe.md", RecipeReference(AllStageOptions())));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/cairn.bash", BashCompletion(*program)));
  return WriteFileAtomically(pages + "/cairn.1", ProgramPage(*program, ProgramVersion()));
}

}  // namespace

Command ManualCommand() {
  auto folder = std::make_shared<std::string>();
  return {
      .name = "manual",
      .summary = "Write manual pages, completion for bash and the reference of recipes",
      .add_arguments =
          [folder](ArgumentParser& parser) {
            parser.Add("-o,--output", *folder, "Folder to write: man1/*.1, cairn.bash, recipe.md")
                .Required()
                .Type("FOLDER");
          },
      .run = [folder](const CommandEnvironment&) { return WriteManual(*folder); },
  };
}

}  // namespace cairn::pipeline
