#include "pipeline/build/stage_options.h"

#include "sim/render/options.h"
#include "stages/build_vocabulary/build_vocabulary.h"
#include "stages/check_map/check_map.h"
#include "stages/decompose_regions/decompose_regions.h"
#include "stages/decompose_views/decompose_views.h"
#include "stages/emit_map/emit_map.h"
#include "stages/emit_map/leave_out/choose_runs.h"
#include "stages/extract_features/extract_features.h"
#include "stages/filter_visibility/filter_visibility.h"
#include "stages/group_classes/group_classes.h"
#include "stages/link_appearance/link_appearance.h"
#include "stages/match_features/match_features.h"
#include "stages/reconstruct/reconstruct.h"

namespace cairn::pipeline {

std::vector<StageOptions> AllStageOptions() {
  return {
      MakeStageOptions<sim::SimulateOptions>("simulate"),
      MakeStageOptions<extract_features::ExtractFeaturesOptions>("extract_features"),
      MakeStageOptions<match_features::MatchFeaturesOptions>("match_features"),
      MakeStageOptions<reconstruct::ReconstructOptions>("reconstruct"),
      MakeStageOptions<group_classes::GroupClassesOptions>("group_classes"),
      MakeStageOptions<filter_visibility::FilterVisibilityOptions>("filter_visibility"),
      MakeStageOptions<decompose_regions::DecomposeRegionsOptions>("decompose_regions"),
      MakeStageOptions<build_vocabulary::BuildVocabularyOptions>("build_vocabulary"),
      MakeStageOptions<link_appearance::LinkAppearanceOptions>("link_appearance"),
      MakeStageOptions<decompose_views::DecomposeViewsOptions>("decompose_views"),
      MakeStageOptions<emit_map::EmitMapOptions>("emit_map"),
      MakeStageOptions<emit_map::LeaveOutOptions>("leave_out"),
      MakeStageOptions<check_map::CheckMapOptions>("check_map"),
  };
}

}  // namespace cairn::pipeline
