#include "stages/emit_map/survey_files.h"

#include <algorithm>

#include "core/line/memory.h"

namespace cairn::emit_map {
namespace {

// Bytes of memory per byte of the classes (bench/scale/README.md), and beside them what does not grow for
// ever: sights that are kept (LandmarkOrderOptions).
constexpr double kMemoryPerFileByte = 2, kMemoryPerFileByteOfTrials = 5.5, kMemoryPerFileByteOfSights = 7;
constexpr double kMostMemoryOfSights = double{1 << 30};

}  // namespace

void AddSurveyFiles(const std::string& appearance_help, ArgumentParser& parser, SurveyFiles* files) {
  parser.Add("--classes", files->classes_path, "classes.db").Required().Type("classes.db");
  parser.Add("--world", files->world_path, "world.db").Required().Type("world.db");
  parser.Add("--regions", files->regions_path, "regions.db").Required().Type("regions.db");
  parser.Add("--vocabulary", files->vocabulary_path, "vocabulary.db").Required().Type("vocabulary.db");
  parser.Add("--appearance", files->appearance_path, appearance_help).Type("appearance.db");
}

Status CheckMemoryForSurvey(const std::string& work, const SurveyFiles& files, bool by_trial,
                            int64_t memory_mib) {
  return CheckMemoryForFile(
      work, files.classes_path,
      [&](double file) {
        if (!by_trial) return kMemoryPerFileByte * file;
        return kMemoryPerFileByteOfTrials * file +
               std::min(kMemoryPerFileByteOfSights * file, kMostMemoryOfSights);
      },
      memory_mib);
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
