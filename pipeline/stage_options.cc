#include "pipeline/stage_options.h"

#include "stages/build_vocabulary/build_vocabulary.h"
#include "stages/check_map/check_map.h"
#include "stages/decompose_regions/decompose_regions.h"
#include "stages/decompose_views/decompose_views.h"
#include "stages/emit_map/emit_map.h"
#include "stages/extract_features/extract_features.h"
#include "stages/filter_visibility/filter_visibility.h"
#include "stages/group_classes/group_classes.h"
#include "stages/link_appearance/link_appearance.h"
#include "stages/match_features/match_features.h"
#include "stages/reconstruct/reconstruct.h"
#include "stages/simulate/options.h"

namespace cairn {

std::vector<StageOptions> AllStageOptions() {
  return {
      MakeStageOptions<SimulateOptions>("simulate"),
      MakeStageOptions<ExtractFeaturesOptions>("extract_features"),
      MakeStageOptions<MatchFeaturesOptions>("match_features"),
      MakeStageOptions<ReconstructOptions>("reconstruct"),
      MakeStageOptions<GroupClassesOptions>("group_classes"),
      MakeStageOptions<FilterVisibilityOptions>("filter_visibility"),
      MakeStageOptions<DecomposeRegionsOptions>("decompose_regions"),
      MakeStageOptions<BuildVocabularyOptions>("build_vocabulary"),
      MakeStageOptions<LinkAppearanceOptions>("link_appearance"),
      MakeStageOptions<DecomposeViewsOptions>("decompose_views"),
      MakeStageOptions<EmitMapOptions>("emit_map"),
      MakeStageOptions<CheckMapOptions>("check_map"),
  };
}

}  // namespace cairn
