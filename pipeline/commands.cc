#include "pipeline/commands.h"

#include "pipeline/compile_command.h"

#if defined(CAIRN_HAS_simulate)
#include "stages/simulate/command.h"
#endif
#if defined(CAIRN_HAS_simulate_worlds)
#include "stages/simulate_worlds/command.h"
#endif
#if defined(CAIRN_HAS_extract_features)
#include "stages/extract_features/command.h"
#endif
#if defined(CAIRN_HAS_match_features)
#include "stages/match_features/command.h"
#endif
#if defined(CAIRN_HAS_group_classes)
#include "stages/group_classes/command.h"
#endif
#if defined(CAIRN_HAS_filter_visibility)
#include "stages/filter_visibility/command.h"
#endif
#if defined(CAIRN_HAS_decompose_regions)
#include "stages/decompose_regions/command.h"
#endif
#if defined(CAIRN_HAS_build_vocabulary)
#include "stages/build_vocabulary/command.h"
#endif
#if defined(CAIRN_HAS_emit_map)
#include "stages/emit_map/command.h"
#endif
#if defined(CAIRN_HAS_check_map)
#include "stages/check_map/command.h"
#endif
#if defined(CAIRN_HAS_localize_command)
#include "pipeline/localize_command.h"
#endif
#if defined(CAIRN_HAS_inspect_command)
#include "pipeline/inspect_command.h"
#endif

namespace cairn {

std::vector<Command> AllCommands() {
  return {
#if defined(CAIRN_HAS_simulate)
    SimulateCommand(),
#endif
#if defined(CAIRN_HAS_extract_features)
        ExtractFeaturesCommand(),
#endif
#if defined(CAIRN_HAS_match_features)
        MatchFeaturesCommand(),
#endif
#if defined(CAIRN_HAS_group_classes)
        GroupClassesCommand(),
#endif
#if defined(CAIRN_HAS_filter_visibility)
        FilterVisibilityCommand(),
#endif
#if defined(CAIRN_HAS_decompose_regions)
        DecomposeRegionsCommand(), CheckRegionsCommand(),
#endif
#if defined(CAIRN_HAS_build_vocabulary)
        BuildVocabularyCommand(),
#endif
#if defined(CAIRN_HAS_emit_map)
        EmitMapCommand(),
#endif
#if defined(CAIRN_HAS_check_map)
        CheckMapCommand(),
#endif
#if defined(CAIRN_HAS_localize_command)
        LocalizeCommand(),
#endif
#if defined(CAIRN_HAS_inspect_command)
        InspectCommand(),
#endif
#if defined(CAIRN_HAS_simulate_worlds)
        SimulateWorldsCommand(),
#endif
        CompileCommand(), ConfigureCommand(), RecipeReferenceCommand(),
  };
}

}  // namespace cairn
