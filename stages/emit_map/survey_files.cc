#include "stages/emit_map/survey_files.h"

namespace cairn::emit_map {

void AddSurveyFiles(const std::string& appearance_help, ArgumentParser& parser, SurveyFiles* files) {
  parser.Add("--classes", files->classes_path, "classes.db").Required().Type("classes.db");
  parser.Add("--world", files->world_path, "world.db").Required().Type("world.db");
  parser.Add("--regions", files->regions_path, "regions.db").Required().Type("regions.db");
  parser.Add("--vocabulary", files->vocabulary_path, "vocabulary.db").Required().Type("vocabulary.db");
  parser.Add("--appearance", files->appearance_path, appearance_help).Type("appearance.db");
}

Result<SurveyData> ReadSurveyFiles(const SurveyFiles& files) {
  SurveyData data;
  CAIRN_ASSIGN_OR_RETURN(data.classes, ReadClasses(files.classes_path));
  CAIRN_ASSIGN_OR_RETURN(data.parts.world, ReadWorld(files.world_path));
  CAIRN_ASSIGN_OR_RETURN(data.parts.decomposition, ReadDecomposition(files.regions_path));
  CAIRN_ASSIGN_OR_RETURN(data.vocabulary, ReadVocabulary(files.vocabulary_path));
  CAIRN_RETURN_IF_ERROR(
      CheckSameKind(data.vocabulary.kind, data.classes.descriptor_kind, files.vocabulary_path));
  if (!files.appearance_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(data.parts.appearance, ReadAppearance(files.appearance_path));
  }
  return data;
}

}  // namespace cairn::emit_map
