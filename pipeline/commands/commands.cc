#include "pipeline/commands/commands.h"

#include "sim/worlds/command.h"
#include "stages/build_vocabulary/command.h"
#include "stages/check_map/command.h"
#include "stages/decompose_regions/command.h"
#include "stages/decompose_views/command.h"
#include "stages/emit_map/command.h"
#include "stages/extract_features/command.h"
#include "stages/filter_visibility/command.h"
#include "stages/group_classes/command.h"
#include "stages/link_appearance/command.h"
#include "stages/match_features/command.h"
#include "stages/reconstruct/command.h"
#include "stages/simulate/command.h"

namespace cairn::pipeline {

std::vector<Command> AllCommands() {
  return {
      simulate::SimulateCommand(),
      extract_features::ExtractFeaturesCommand(),
      match_features::MatchFeaturesCommand(),
      reconstruct::ReconstructCommand(),
      group_classes::GroupClassesCommand(),
      filter_visibility::FilterVisibilityCommand(),
      decompose_regions::DecomposeRegionsCommand(),
      decompose_regions::CheckRegionsCommand(),
      build_vocabulary::BuildVocabularyCommand(),
      emit_map::EmitMapCommand(),
      check_map::CheckMapCommand(),
      LocalizeCommand(),
      ImportCommand(),
      ExportCommand(),
      InspectCommand(),
      sim::SimulateWorldsCommand(),
      CompileCommand(),
      ConfigureCommand(),
      RecipeReferenceCommand(),
      CleanCommand(),
      JoinCapturesCommand(),
      VerifyCommand(),
      KeygenCommand(),
      SignCommand(),
      MigrateCommand(),
      link_appearance::LinkAppearanceCommand(),
      link_appearance::CheckAppearanceCommand(),
      RouteCommand(),
      decompose_views::DecomposeViewsCommand(),
      LocateScanCommand(),
      PlanPathCommand(),
      TellApartCommand(),
      DriveCommand(),
      ExplainCommand(),
      DiffCommand(),
      DeltaCommand(),
      ApplyCommand(),
      RollbackCommand(),
      ParetoCommand(),
      ReportCommand(),
      ManualCommand(),
  };
}

}  // namespace cairn::pipeline
