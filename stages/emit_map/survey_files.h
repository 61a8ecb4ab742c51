#pragma once

#include <cstdint>
#include <string>

#include "core/base/error.h"
#include "core/line/arguments.h"
#include "core/vocabulary/vocabulary_tree.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/choose/leave_out_images.h"

namespace cairn::emit_map {

// The stages' files of which a map is made.
struct SurveyFiles {
  std::string classes_path;
  std::string world_path;
  std::string regions_path;
  std::string vocabulary_path;
  std::string appearance_path;  // empty: none
};

// Adds --classes to --appearance.
void AddSurveyFiles(const std::string& appearance_help, ArgumentParser& parser, SurveyFiles* files);

// What stands in them.
struct SurveyData {
  Classes classes;
  SurveyParts parts;
  Vocabulary vocabulary;
};
// Refuses a survey that takes more memory than is allowed: `by_trial`: maps of parts of it are tried. Errors:
// Failed.
Status CheckMemoryForSurvey(const std::string& work, const SurveyFiles& files, bool by_trial,
                            int64_t memory_mib);
// Errors: those of the files' readers.
Result<SurveyData> ReadSurveyFiles(const SurveyFiles& files);

}  // namespace cairn::emit_map
