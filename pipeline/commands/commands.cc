#include "pipeline/commands/commands.h"

#include <string>
#include <utility>

#include "sim/worlds/command.h"
#include "stages/build_vocabulary/command.h"
#include "stages/check_map/command.h"
#include "stages/decompose_regions/command.h"
#include "stages/decompose_views/command.h"
#include "stages/emit_map/command.h"
#include "stages/emit_map/leave_out/command.h"
#include "stages/extract_features/command.h"
#include "stages/filter_visibility/command.h"
#include "stages/group_classes/command.h"
#include "stages/link_appearance/command.h"
#include "stages/match_features/command.h"
#include "stages/reconstruct/command.h"
#include "stages/simulate/command.h"

namespace cairn::pipeline {
namespace {

// `cairn NAME WORD`: commands of one subject.
Command Family(const std::string& name, const std::string& summary, std::vector<Command> subcommands) {
  return {.name = name, .summary = summary, .subcommands = std::move(subcommands)};
}

Command StageFamily() {
  return Family("stage", "One stage alone, as Makefiles call it",
                {ConfigureCommand(), simulate::SimulateCommand(), extract_features::ExtractFeaturesCommand(),
                 match_features::MatchFeaturesCommand(), reconstruct::ReconstructCommand(),
                 group_classes::GroupClassesCommand(), filter_visibility::FilterVisibilityCommand(),
                 decompose_regions::DecomposeRegionsCommand(), build_vocabulary::BuildVocabularyCommand(),
                 link_appearance::LinkAppearanceCommand(), emit_map::EmitMapCommand(),
                 emit_map::LeaveOutCommand(), decompose_regions::CheckRegionsCommand(),
                 link_appearance::CheckAppearanceCommand(), sim::SimulateWorldsCommand()});
}

Command PlanFamily() {
  return Family("plan", "Floor plans and laser scans: where a scan was taken, paths, look-alike places",
                {decompose_views::DecomposeViewsCommand(), LocateScanCommand(), FollowScansCommand(),
                 PlanPathCommand(), TellApartCommand(), NextLookCommand()});
}

Command UpdateFamily() {
  return Family("update", "Bring a robot's map from one release to the next, or back",
                {DeltaCommand(), ApplyCommand(), RollbackCommand()});
}

Command KeysFamily() {
  return Family("keys", "Rings of keys: several people sign, and a key that is lost or stolen is replaced",
                {MakeKeysCommand(), SignKeysCommand(), ShowKeysCommand(), AcceptKeysCommand()});
}

}  // namespace

std::vector<Command> AllCommands() {
  const std::vector<std::pair<std::string, std::vector<Command>>> groups = {
      {"Maps from surveys",
       {ImportCommand(), FeaturesCommand(), JoinCommand(), CompileCommand(), UpdateMapCommand(),
        ParetoCommand(), CleanCommand(), StageFamily()}},
      {"What a map holds",
       {InspectCommand(), check_map::CheckMapCommand(), ReportCommand(), DiffCommand(), ExportCommand()}},
      {"Where a robot is",
       {LocalizeCommand(), WhereCommand(), AtlasCommand(), PlanFamily(), RouteCommand(), DriveCommand()}},
      {"Releases",
       {VerifyCommand(), KeygenCommand(), KeysFamily(), SignCommand(), UpdateFamily(), MigrateCommand()}},
      {"", {ManualCommand()}},
  };
  std::vector<Command> commands;
  for (const auto& [heading, of_group] : groups) {
    for (const Command& command : of_group) {
      commands.push_back(command);
      commands.back().heading = heading;
    }
  }
  return commands;
}

}  // namespace cairn::pipeline
