#include "pipeline/commands.h"

#include "pipeline/clean_command.h"
#include "pipeline/compile_command.h"
#include "pipeline/delta_commands.h"
#include "pipeline/diff_command.h"
#include "pipeline/drive_command.h"
#include "pipeline/explain_command.h"
#include "pipeline/export_command.h"
#include "pipeline/import_command.h"
#include "pipeline/inspect_command.h"
#include "pipeline/join_command.h"
#include "pipeline/localize_command.h"
#include "pipeline/locate_scan_command.h"
#include "pipeline/manual_command.h"
#include "pipeline/pareto_command.h"
#include "pipeline/plan_path_command.h"
#include "pipeline/report_command.h"
#include "pipeline/route_command.h"
#include "pipeline/seal_commands.h"
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
#include "stages/simulate_worlds/command.h"

namespace cairn {

std::vector<Command> AllCommands() {
  return {
      SimulateCommand(),
      ExtractFeaturesCommand(),
      MatchFeaturesCommand(),
      ReconstructCommand(),
      GroupClassesCommand(),
      FilterVisibilityCommand(),
      DecomposeRegionsCommand(),
      CheckRegionsCommand(),
      BuildVocabularyCommand(),
      EmitMapCommand(),
      CheckMapCommand(),
      LocalizeCommand(),
      ImportCommand(),
      ExportCommand(),
      InspectCommand(),
      SimulateWorldsCommand(),
      CompileCommand(),
      ConfigureCommand(),
      RecipeReferenceCommand(),
      CleanCommand(),
      JoinCapturesCommand(),
      VerifyCommand(),
      KeygenCommand(),
      SignCommand(),
      MigrateCommand(),
      LinkAppearanceCommand(),
      CheckAppearanceCommand(),
      RouteCommand(),
      DecomposeViewsCommand(),
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

}  // namespace cairn
