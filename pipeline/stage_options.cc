#include "pipeline/stage_options.h"

#if defined(CAIRN_HAS_simulate)
#include "stages/simulate/options.h"
#endif
#if defined(CAIRN_HAS_extract_features)
#include "stages/extract_features/extract_features.h"
#endif
#if defined(CAIRN_HAS_match_features)
#include "stages/match_features/match_features.h"
#endif
#if defined(CAIRN_HAS_group_classes)
#include "stages/group_classes/group_classes.h"
#endif
#if defined(CAIRN_HAS_filter_visibility)
#include "stages/filter_visibility/filter_visibility.h"
#endif
#if defined(CAIRN_HAS_decompose_regions)
#include "stages/decompose_regions/decompose_regions.h"
#endif
#if defined(CAIRN_HAS_build_vocabulary)
#include "stages/build_vocabulary/build_vocabulary.h"
#endif
#if defined(CAIRN_HAS_emit_map)
#include "stages/emit_map/emit_map.h"
#endif
#if defined(CAIRN_HAS_check_map)
#include "stages/check_map/check_map.h"
#endif

namespace cairn {

std::vector<StageOptions> AllStageOptions() {
  return {
#if defined(CAIRN_HAS_simulate)
    MakeStageOptions<SimulateOptions>("simulate"),
#endif
#if defined(CAIRN_HAS_extract_features)
        MakeStageOptions<ExtractFeaturesOptions>("extract_features"),
#endif
#if defined(CAIRN_HAS_match_features)
        MakeStageOptions<MatchFeaturesOptions>("match_features"),
#endif
#if defined(CAIRN_HAS_group_classes)
        MakeStageOptions<GroupClassesOptions>("group_classes"),
#endif
#if defined(CAIRN_HAS_filter_visibility)
        MakeStageOptions<FilterVisibilityOptions>("filter_visibility"),
#endif
#if defined(CAIRN_HAS_decompose_regions)
        MakeStageOptions<DecomposeRegionsOptions>("decompose_regions"),
#endif
#if defined(CAIRN_HAS_build_vocabulary)
        MakeStageOptions<BuildVocabularyOptions>("build_vocabulary"),
#endif
#if defined(CAIRN_HAS_emit_map)
        MakeStageOptions<EmitMapOptions>("emit_map"),
#endif
#if defined(CAIRN_HAS_check_map)
        MakeStageOptions<CheckMapOptions>("check_map"),
#endif
  };
}

}  // namespace cairn
